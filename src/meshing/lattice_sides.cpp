#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>

#include "isotrack/meshing/lattice_topology.h"
#include "meshing/lattice_lines.h"

namespace isotrack {

Uprights::Uprights(const std::vector<Eigen::Vector3i>& nodes) {
    if (nodes.empty()) return;
    constexpr std::size_t kBlock = 65536;
    const std::size_t blocks = (nodes.size() + kBlock - 1) / kBlock;
    const auto for_each_block = [&](const auto& body) {
        tbb::parallel_for(std::size_t{0}, blocks, [&](std::size_t b) {
            body(b, nodes.data() + b * kBlock, nodes.data() + std::min(nodes.size(), (b + 1) * kBlock));
        });
    };
    std::vector<std::pair<int, int>> ranges(blocks);
    for_each_block([&](std::size_t b, const auto* from, const auto* to) {
        const auto [low, high] =
            std::minmax_element(from, to, [](const auto& p, const auto& q) { return p.x() < q.x(); });
        ranges[b] = {low->x(), high->x()};
    });
    int high_x = ranges[0].second;
    low_x_ = ranges[0].first;
    for (const auto& [low, high] : ranges) {
        low_x_ = std::min(low_x_, low);
        high_x = std::max(high_x, high);
    }
    const auto layers = static_cast<std::size_t>(high_x - low_x_) + 1;
    std::vector<std::vector<std::size_t>> next(blocks);  // at first the count of each layer
    for_each_block([&](std::size_t b, const auto* from, const auto* to) {
        next[b].assign(layers, 0);
        for (; from != to; ++from) ++next[b][from->x() - low_x_];
    });
    first_.assign(layers + 1, 0);
    std::size_t at = 0;
    for (std::size_t layer = 0; layer < layers; ++layer) {
        first_[layer] = at;
        for (auto& of_block : next) at += std::exchange(of_block[layer], at);
    }
    first_[layers] = at;
    nodes_.resize(nodes.size());
    for_each_block([&](std::size_t b, const auto* from, const auto* to) {
        for (; from != to; ++from) nodes_[next[b][from->x() - low_x_]++] = {from->y(), from->z()};
    });
    tbb::parallel_for(std::size_t{0}, layers, [&](std::size_t i) {
        sort_by_line(nodes_.data() + first_[i], nodes_.data() + first_[i + 1]);
    });
}

Uprights::Range Uprights::line(int x, int y) const {
    auto [begin, end] = layer(x);
    begin = std::partition_point(begin, end, [&](const Node& n) { return n.y < y; });
    return {begin, std::find_if(begin, end, [&](const Node& n) { return n.y != y; })};
}

LatticeSides::LatticeSides(const Surface& surface) : surface_(surface) {
    tbb::parallel_invoke(
        [&] {
            diagonals_ = surface.diagonals();
            const auto least_x = [](const Surface::Diagonal& d) { return std::min(d.from.x(), d.to.x()); };
            std::stable_sort(diagonals_.begin(), diagonals_.end(),
                             [&](const auto& a, const auto& b) { return least_x(a) < least_x(b); });
        },
        [&] { uprights_ = Uprights(surface.upright_crossings()); });
}

}  // namespace isotrack
