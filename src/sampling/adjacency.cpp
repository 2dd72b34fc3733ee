#include "isotrack/sampling/adjacency.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <utility>

#include "find_in_blocks.h"
#include "sampling/compact.h"

namespace isotrack {

namespace {

constexpr std::size_t kRoomAlongMesh = 7;  // six on average

/// `list(i, found)`, called by several threads, appends the neighbours of i to the end of `found`, ascending.
/// `room_each`: entries to make room for per particle, from the start; 0 where most may have none.
template <typename List>
Adjacency from_lists(std::size_t count, std::size_t room_each, const List& list) {
    constexpr std::size_t kBlock = 256;  // lists are long, and what a thread holds of them it keeps
    Adjacency result;
    result.first.resize(count + 1);
    result.adjacent =
        find_in_blocks<int>(count, kBlock, [&](std::size_t begin, std::size_t end, std::vector<int>& found) {
            found.reserve(room_each * (end - begin));
            for (std::size_t i = begin; i < end; ++i) {
                const std::size_t before = found.size();
                list(i, found);
                result.first[i + 1] = static_cast<int>(found.size() - before);
            }
        });
    std::partial_sum(result.first.begin(), result.first.end(), result.first.begin());
    return result;
}

}  // namespace

Adjacency Adjacency::restricted(const std::vector<char>& keep) const {
    const std::vector<int> number = numbers_after(keep);
    std::vector<int> kept;
    kept.reserve(size());
    for (std::size_t i = 0; i < size(); ++i)
        if (keep[i]) kept.push_back(static_cast<int>(i));
    return from_lists(kept.size(), kRoomAlongMesh, [&](std::size_t n, std::vector<int>& found) {
        const int i = kept[n];
        const std::size_t start = found.size();
        bool bridged = false;
        for (const int j : of(i)) {
            if (keep[j]) {
                found.push_back(number[j]);
                continue;
            }
            bridged = true;
            for (const int k : of(j))
                if (keep[k] && k != i) found.push_back(number[k]);
        }
        if (!bridged) return;
        const auto from = found.begin() + static_cast<std::ptrdiff_t>(start);
        std::sort(from, found.end());
        found.erase(std::unique(from, found.end()), found.end());
    });
}

namespace {

/// `for_each_pair(visit)` calls visit(i, j) for every directed pair, in the same order whenever it is called.
template <typename ForEachPair>
Adjacency gather(std::size_t count, const ForEachPair& for_each_pair) {
    // All lists with their repeats, then each sorted and made unique in its place.
    std::vector<int> first(count + 1, 0);
    for_each_pair([&](int i, int) { ++first[i + 1]; });
    for (std::size_t i = 0; i < count; ++i) first[i + 1] += first[i];
    std::vector<int> second(first[count]), end(first.begin(), first.end() - 1);
    for_each_pair([&](int i, int j) { second[end[i]++] = j; });
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 1024), [&](const auto& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            const auto from = second.begin() + first[i];
            std::sort(from, second.begin() + end[i]);
            end[i] = static_cast<int>(std::unique(from, second.begin() + end[i]) - second.begin());
        }
    });
    Adjacency result;
    result.first.resize(count + 1);
    for (std::size_t i = 0; i < count; ++i) result.first[i + 1] = result.first[i] + end[i] - first[i];
    if (result.first == first) {  // there are none
        result.adjacent = std::move(second);
        return result;
    }
    result.adjacent.resize(result.first[count]);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 1024), [&](const auto& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i)
            std::copy(second.begin() + first[i], second.begin() + end[i],
                      result.adjacent.begin() + result.first[i]);
    });
    return result;
}

}  // namespace

Adjacency from_pairs(const std::vector<std::pair<int, int>>& pairs, std::size_t count) {
    return gather(count, [&](const auto& visit) {
        for (const auto& [i, j] : pairs) visit(i, j);
    });
}

Adjacency ring_of(const std::vector<std::array<int, 3>>& triangles, std::size_t count) {
    const auto for_each_edge = [&](const auto& visit) {
        for (const auto& [a, b, c] : triangles)
            for (const auto& [i, j] : {std::pair(a, b), std::pair(b, c), std::pair(c, a)}) visit(i, j);
    };
    // In a mesh without a border each edge comes from one triangle forwards, from another backwards.
    Adjacency result = gather(count, for_each_edge);
    constexpr std::size_t kBlock = 1024;
    const auto is_one_way = [&](int i, int j) {
        const Adjacency::Range back = result.of(j);
        return !std::binary_search(back.begin(), back.end(), i);
    };
    const auto one_way =
        find_in_blocks<int>(count, kBlock, [&](std::size_t begin, std::size_t end, std::vector<int>& found) {
            for (std::size_t n = begin; n < end; ++n) {
                const int i = static_cast<int>(n);
                const Adjacency::Range near = result.of(n);
                if (std::any_of(near.begin(), near.end(), [&](int j) { return is_one_way(i, j); }))
                    found.push_back(i);
            }
        });
    if (one_way.empty()) return result;
    return gather(count, [&](const auto& visit) {
        for_each_edge(visit);
        for_each_edge([&](int i, int j) { visit(j, i); });
    });
}

Adjacency Adjacency::extended(const std::vector<std::array<int, 3>>& newborn, std::size_t count) const {
    std::vector<std::pair<int, int>> links;  // from those there are to newborn ones
    for (std::size_t k = 0; k < newborn.size(); ++k)
        for (const int j : newborn[k]) links.emplace_back(j, static_cast<int>(size() + k));
    const Adjacency added = from_pairs(links, size());
    return from_lists(count, kRoomAlongMesh, [&](std::size_t i, std::vector<int>& found) {
        const auto append = [&](const auto& some) { found.insert(found.end(), some.begin(), some.end()); };
        if (i < size()) {
            append(of(i));
            append(added.of(i));
        } else if (i < size() + newborn.size()) {
            std::array<int, 3> corners = newborn[i - size()];
            std::sort(corners.begin(), corners.end());
            append(corners);
        }
    });
}

Adjacency Adjacency::squared(const std::vector<char>& some) const {
    // Per thread: the particle whose list somebody was put on last.
    tbb::enumerable_thread_specific<std::vector<int>> listed_by([&] { return std::vector<int>(size(), -1); });
    return from_lists(size(), 0, [&](std::size_t i, std::vector<int>& found) {
        if (!some.empty() && !some[i]) return;
        std::vector<int>& listed = listed_by.local();
        const std::size_t start = found.size();
        const int self = static_cast<int>(i);
        listed[i] = self;
        const auto list = [&](int j) {
            if (listed[j] == self) return;
            listed[j] = self;
            found.push_back(j);
        };
        for (const int j : of(i)) {
            list(j);
            for (const int k : of(j)) list(k);
        }
        std::sort(found.begin() + static_cast<std::ptrdiff_t>(start), found.end());
    });
}

std::vector<std::vector<ParticleBlock>> colour_groups(const Adjacency& adjacency, int longest,
                                                      const std::vector<char>& some) {
    const int count = static_cast<int>(adjacency.size());
    const auto end_of_block = [&](int begin) {
        int end = begin + 1;
        for (; end < count && end - begin < longest; ++end) {
            const Adjacency::Range near = adjacency.of(end);
            if (std::none_of(near.begin(), near.end(), [&](int j) { return begin <= j && j < end; })) break;
        }
        return end;
    };
    if (count == 0) return {};
    std::vector<int> colour(adjacency.size(), 0);
    std::vector<std::vector<ParticleBlock>> groups(1);
    std::vector<int> taken_at(1, -1);  // per group: the begin of the last block that has a neighbour in it
    for (ParticleBlock block{0, 0}; block.begin < count; block.begin = block.end) {
        block.end = end_of_block(block.begin);
        const bool is_left_out =
            !some.empty() && std::none_of(some.begin() + block.begin, some.begin() + block.end,
                                          [](char flag) { return flag != 0; });
        const bool has_no_list = adjacency.first[block.begin] == adjacency.first[block.end];
        if (is_left_out && has_no_list) continue;  // most; its colour is 0, which it has
        for (int i = block.begin; i < block.end; ++i)
            for (const int j : adjacency.of(i))
                if (j < block.begin) taken_at[colour[j]] = block.begin;
        std::size_t free = 0;
        while (free < groups.size() && taken_at[free] == block.begin) ++free;
        if (free == groups.size()) {
            groups.emplace_back();
            taken_at.push_back(-1);
        }
        // What is left out has its colour all the same: in which order the others go does not depend on it.
        std::fill(colour.begin() + block.begin, colour.begin() + block.end, static_cast<int>(free));
        if (!is_left_out) groups[free].push_back(block);
    }
    return groups;
}

}  // namespace isotrack
