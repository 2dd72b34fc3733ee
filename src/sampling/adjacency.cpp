#include "isotrack/sampling/adjacency.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstdint>
#include <utility>

#include "find_in_blocks.h"
#include "sampling/compact.h"

namespace isotrack {

Adjacency Adjacency::restricted(const std::vector<char>& keep) const {
    const std::vector<int> number = numbers_after(keep);
    Adjacency result;
    for (std::size_t i = 0; i < size(); ++i) {
        if (!keep[i]) continue;
        const std::size_t start = result.adjacent.size();
        bool bridged = false;
        for (const int j : of(i)) {
            if (keep[j]) {
                result.adjacent.push_back(number[j]);
                continue;
            }
            bridged = true;
            for (const int k : of(j))
                if (keep[k] && k != static_cast<int>(i)) result.adjacent.push_back(number[k]);
        }
        if (bridged) {
            const auto from = result.adjacent.begin() + static_cast<std::ptrdiff_t>(start);
            std::sort(from, result.adjacent.end());
            result.adjacent.erase(std::unique(from, result.adjacent.end()), result.adjacent.end());
        }
        result.first.push_back(static_cast<int>(result.adjacent.size()));
    }
    return result;
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
    return gather(count, [&](const auto& visit) {
        for (const auto& [a, b, c] : triangles)
            for (const auto& [i, j] : {std::pair(a, b), std::pair(b, c), std::pair(c, a)}) {
                visit(i, j);
                visit(j, i);
            }
    });
}

Adjacency Adjacency::extended(const std::vector<std::array<int, 3>>& newborn, std::size_t count) const {
    if (newborn.empty()) {
        Adjacency result = *this;
        result.first.resize(count + 1, result.first.back());
        return result;
    }
    return gather(count, [&](const auto& visit) {
        for (std::size_t i = 0; i < size(); ++i)
            for (const int j : of(i)) visit(static_cast<int>(i), j);
        for (std::size_t k = 0; k < newborn.size(); ++k)
            for (const int j : newborn[k]) {
                visit(static_cast<int>(size() + k), j);
                visit(j, static_cast<int>(size() + k));
            }
    });
}

Adjacency Adjacency::squared(const std::vector<char>& some) const {
    constexpr std::size_t kBlock = 1024;
    Adjacency result;
    result.first.resize(size() + 1);
    // Per thread: the particle whose list somebody was put on last.
    tbb::enumerable_thread_specific<std::vector<int>> listed_by([&] { return std::vector<int>(size(), -1); });
    const auto find = [&](std::size_t begin, std::size_t end, std::vector<int>& found) {
        std::vector<int>& listed = listed_by.local();
        for (std::size_t i = begin; i < end; ++i) {
            if (!some.empty() && !some[i]) continue;
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
            result.first[i + 1] = static_cast<int>(found.size() - start);
        }
    };
    result.adjacent = find_in_blocks<int>(size(), kBlock, find);
    for (std::size_t i = 0; i < size(); ++i) result.first[i + 1] += result.first[i];
    return result;
}

std::vector<std::vector<ParticleBlock>> colour_groups(const Adjacency& adjacency, int longest) {
    const int count = static_cast<int>(adjacency.size());
    std::vector<ParticleBlock> blocks;
    for (int i = 0; i < count; ++i) {
        const Adjacency::Range near = adjacency.of(i);
        const bool goes_on =
            i > 0 && i - blocks.back().begin < longest &&
            std::any_of(near.begin(), near.end(), [&](int j) { return j < i && j >= blocks.back().begin; });
        if (goes_on)
            blocks.back().end = i + 1;
        else
            blocks.push_back({i, i + 1});
    }
    std::vector<int> colour(adjacency.size(), -1);
    std::vector<std::vector<ParticleBlock>> groups;
    std::vector<char> taken;
    for (const ParticleBlock& block : blocks) {
        taken.assign(groups.size() + 1, 0);
        for (int i = block.begin; i < block.end; ++i)
            for (const int j : adjacency.of(i))
                if (colour[j] >= 0) taken[colour[j]] = 1;
        const auto free = std::find(taken.begin(), taken.end(), 0) - taken.begin();
        if (free == static_cast<std::ptrdiff_t>(groups.size())) groups.emplace_back();
        std::fill(colour.begin() + block.begin, colour.begin() + block.end, static_cast<int>(free));
        groups[free].push_back(block);
    }
    return groups;
}

}  // namespace isotrack
