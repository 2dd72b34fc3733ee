// In front of TBB's header of that name when the thread sanitizer is on; see parallel_for.h.
#pragma once

#include <tbb/parallel_for.h>

#include <limits>
#include <memory>
#include <type_traits>
#include <vector>

namespace tbb {
namespace instrumented {

/// Joins the values of the leaves of `range` from `next` on by the tree of its halvings.
template <typename Range, typename Value, typename Join>
Value join_leaves(Range range, const Join& join, const Value*& next) {
    if (!range.is_divisible()) return *next++;
    Range right(range, split());
    const Value left = join_leaves(range, join, next);
    return join(left, join_leaves(right, join, next));
}

}  // namespace instrumented

/// The grain counts here: the tree of halvings is what makes the result that of any number of threads.
template <typename Range, typename Value, typename Function, typename Join>
Value parallel_deterministic_reduce(const Range& range, const Value& identity, const Function& function,
                                    const Join& join) {
    static_assert(!std::is_same_v<Value, bool>, "neighbours in a vector<bool> share a word");
    if (range.empty()) return identity;
    std::vector<Range> leaves;
    instrumented::cut(range, std::numeric_limits<int>::max(), leaves);
    std::vector<Value> values(leaves.size(), identity);
    instrumented::run(leaves.size(), [&](std::size_t i) { values[i] = function(leaves[i], identity); });
    const Value* next = values.data();
    return instrumented::join_leaves(range, join, next);
}

template <typename Range, typename Value, typename Function, typename Join>
Value parallel_reduce(const Range& range, const Value& identity, const Function& function, const Join& join) {
    return parallel_deterministic_reduce(range, identity, function, join);
}

template <typename Range, typename Body>
void parallel_reduce(const Range& range, Body& body) {
    const std::vector<Range> pieces = instrumented::cut(range);
    std::vector<std::unique_ptr<Body>> bodies;
    for (std::size_t i = 0; i < pieces.size(); ++i) bodies.push_back(std::make_unique<Body>(body, split()));
    instrumented::run(pieces.size(), [&](std::size_t i) {
        Range piece = pieces[i];
        (*bodies[i])(piece);
    });
    for (const auto& other : bodies) body.join(*other);
}

}  // namespace tbb
