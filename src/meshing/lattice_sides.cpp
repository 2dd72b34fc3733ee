#include <tbb/parallel_invoke.h>

#include <algorithm>

#include "isotrack/meshing/lattice_topology.h"

namespace isotrack {

LatticeSides::LatticeSides(const Surface& surface) : surface_(surface) {
    tbb::parallel_invoke(
        [&] {
            diagonals_ = surface.diagonals();
            const auto least_x = [](const Surface::Diagonal& d) { return std::min(d.from.x(), d.to.x()); };
            std::stable_sort(diagonals_.begin(), diagonals_.end(),
                             [&](const auto& a, const auto& b) { return least_x(a) < least_x(b); });
        },
        [&] {
            std::vector<Upright> uprights;
            const std::vector<Eigen::Vector3i> nodes = surface.upright_crossings();
            uprights.reserve(nodes.size());
            for (const Eigen::Vector3i& node : nodes) uprights.push_back({node.x(), node.y(), node.z()});
            uprights_ = Uprights(uprights);
        });
}

LatticeSides::Uprights::Range LatticeSides::line(int x, int y) const {
    auto [begin, end] = uprights_.layer(x);
    begin = std::partition_point(begin, end, [&](const Upright& u) { return u.y < y; });
    return {begin, std::find_if(begin, end, [&](const Upright& u) { return u.y != y; })};
}

}  // namespace isotrack
