// The least and the largest of what several threads find.
#pragma once

#include <atomic>

namespace isotrack {

template <typename T>
void lower_to(std::atomic<T>& least, T candidate) {
    T now = least.load(std::memory_order_relaxed);
    while (candidate < now && !least.compare_exchange_weak(now, candidate, std::memory_order_relaxed)) {
    }
}

template <typename T>
void raise_to(std::atomic<T>& largest, T candidate) {
    T now = largest.load(std::memory_order_relaxed);
    while (now < candidate && !largest.compare_exchange_weak(now, candidate, std::memory_order_relaxed)) {
    }
}

}  // namespace isotrack
