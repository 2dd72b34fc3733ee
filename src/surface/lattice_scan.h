// The crossed edges of a block of lattice nodes, by asking for the value at each.
#pragma once

#include <cstddef>
#include <vector>

#include "isotrack/surface/surface.h"

namespace isotrack {

/// Calls visit(lower node, axis, where on the edge, whether the lower node is inside), all in lattice units,
/// for every edge with a sign change between the `size` nodes from `low` on. Two layers of values are held.
template <typename Visit>
void scan_lattice(Surface::Probe& probe, const Eigen::Affine3d& lattice, const Vec3& low,
                  const Eigen::Array3i& size, const Visit& visit) {
    const auto in_layer = [&](int y, int z) { return static_cast<std::size_t>(y) * size.z() + z; };
    std::vector<double> here(in_layer(size.y(), 0)), next(here.size());
    const auto fill = [&](int x, std::vector<double>& layer) {
        for (int y = 0; y < size.y(); ++y)
            for (int z = 0; z < size.z(); ++z)
                layer[in_layer(y, z)] = probe.value(lattice * (low + Vec3(x, y, z)));
    };
    fill(0, next);
    for (int x = 0; x < size.x(); ++x) {
        here.swap(next);
        if (x + 1 < size.x()) fill(x + 1, next);
        for (int y = 0; y < size.y(); ++y)
            for (int z = 0; z < size.z(); ++z) {
                const double a = here[in_layer(y, z)];
                const auto cross = [&](double b, int axis) {
                    if ((a < 0.0) != (b < 0.0)) visit(low + Vec3(x, y, z), axis, a / (a - b), a < 0.0);
                };
                if (x + 1 < size.x()) cross(next[in_layer(y, z)], 0);
                if (y + 1 < size.y()) cross(here[in_layer(y + 1, z)], 1);
                if (z + 1 < size.z()) cross(here[in_layer(y, z + 1)], 2);
            }
    }
}

}  // namespace isotrack
