// How arrays with an entry per particle or per cell grow.
#pragma once

#include <cstddef>
#include <vector>

namespace isotrack {

/// Room for a sixteenth more than `size`: a DT gains few particles at a time, for which twice the memory
/// would be too much.
template <typename T>
void reserve_with_slack(std::vector<T>& values, std::size_t size) {
    constexpr std::size_t kSlack = 16;
    values.reserve(size + size / kSlack + kSlack);
}

/// Takes the entries out and makes room for others, in the same place where that is about as large: arrays
/// that are made anew in each frame leave holes behind.
template <typename T>
void clear_for(std::vector<T>& values, std::size_t size) {
    constexpr std::size_t kTooMuch = 4;  // the part of it that may be too much
    constexpr std::size_t kFew = 4096;   // or so many
    values.clear();
    if (values.capacity() >= size && values.capacity() <= size + size / kTooMuch + kFew) return;
    std::vector<T>().swap(values);
    reserve_with_slack(values, size);
}

/// Room for one more entry, and with slack where there is none.
template <typename T>
void ensure_room(std::vector<T>& values) {
    if (values.size() == values.capacity()) reserve_with_slack(values, values.size());
}

}  // namespace isotrack
