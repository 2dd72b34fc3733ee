// Lists found by several threads, in an order that does not depend on them.
#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>
#include <vector>

namespace isotrack {

/// `find(begin, end, list)`, called by several threads at once, appends what it finds at the numbers from
/// `begin` to before `end` to the list of their block, of `block_size` > 0. Returns the lists of all numbers
/// below `count`, joined in their order.
template <typename Found, typename Find>
std::vector<Found> find_in_blocks(std::size_t count, std::size_t block_size, const Find& find) {
    std::vector<std::vector<Found>> blocks((count + block_size - 1) / block_size);
    tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t b) {
        find(b * block_size, std::min(count, (b + 1) * block_size), blocks[b]);
    });
    std::vector<std::size_t> first{0};
    for (const auto& block : blocks) first.push_back(first.back() + block.size());
    std::vector<Found> result(first.back());
    tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t b) {
        std::copy(blocks[b].begin(), blocks[b].end(), result.begin() + static_cast<std::ptrdiff_t>(first[b]));
        std::vector<Found>().swap(blocks[b]);
    });
    return result;
}

}  // namespace isotrack
