// In front of TBB's header of that name when the thread sanitizer watches. TBB's library is not instrumented:
// the sanitizer does not see that a task starts after its loop does and ends before it, and reports whatever
// is handed over. Here the bodies run on std::threads, whose start and join it sees. Nothing else orders
// them: what two threads do in one loop is reported unless it is meant to be shared.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/partitioner.h>

#include <cstddef>
#include <exception>
#include <thread>
#include <type_traits>
#include <vector>

namespace tbb {
namespace instrumented {

constexpr std::size_t kThreads = 4;
constexpr int kHalvings = 4;  // of a loop: pieces for every thread, and neighbours on different ones

inline thread_local bool on_worker = false;

/// Calls piece(i) for every i < count. A loop within a loop stays on its thread.
template <typename Piece>
void run(std::size_t count, const Piece& piece) {
    if (on_worker || count < 2) {
        for (std::size_t i = 0; i < count; ++i) piece(i);
        return;
    }
    std::exception_ptr failures[kThreads];
    std::vector<std::thread> threads;
    for (std::size_t t = 0; t < kThreads; ++t)
        threads.emplace_back([&, t] {
            on_worker = true;
            try {
                for (std::size_t i = t; i < count; i += kThreads) piece(i);
            } catch (...) {
                failures[t] = std::current_exception();
            }
        });
    for (std::thread& thread : threads) thread.join();
    for (const std::exception_ptr& failure : failures)
        if (failure) std::rethrow_exception(failure);
}

/// Halves `range` while it can be halved, `halvings` times at most.
template <typename Range>
void cut(Range range, int halvings, std::vector<Range>& pieces) {
    if (halvings == 0 || !range.is_divisible()) {
        pieces.push_back(range);
        return;
    }
    Range right(range, split());
    cut(range, halvings - 1, pieces);
    cut(right, halvings - 1, pieces);
}

template <typename Range>
std::vector<Range> cut(const Range& range) {
    std::vector<Range> pieces;
    if (!range.empty()) cut(range, kHalvings, pieces);
    return pieces;
}

/// Without the grain, which would leave small inputs on one thread.
template <typename Index>
std::vector<blocked_range<Index>> cut(const blocked_range<Index>& range) {
    std::vector<blocked_range<Index>> pieces;
    if (!range.empty()) cut(blocked_range<Index>(range.begin(), range.end()), kHalvings, pieces);
    return pieces;
}

}  // namespace instrumented

template <typename Range, typename Body, typename... Partitioner,
          typename = std::enable_if_t<!std::is_integral_v<Range>>>
void parallel_for(const Range& range, const Body& body, const Partitioner&...) {
    const std::vector<Range> pieces = instrumented::cut(range);
    instrumented::run(pieces.size(), [&](std::size_t i) {
        Range piece = pieces[i];
        const Body own(body);  // as TBB does: a body may hold an accessor
        own(piece);
    });
}

template <typename Index, typename Function, typename = std::enable_if_t<std::is_integral_v<Index>>>
void parallel_for(Index first, Index last, const Function& function) {
    if (first >= last) return;
    parallel_for(blocked_range<Index>(first, last), [&](const blocked_range<Index>& range) {
        for (Index i = range.begin(); i != range.end(); ++i) function(i);
    });
}

}  // namespace tbb
