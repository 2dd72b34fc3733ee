// Seeds on a surface, their DT, and what is carved from it.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "isotrack/delaunay/tetrahedralisation.h"
#include "isotrack/meshing/manifold.h"
#include "isotrack/sampling/cover.h"
#include "isotrack/surface/crossing_grid.h"

namespace isotrack::support {

/// As `cover` lays them, about an edge apart.
struct Samples {
    SizingLimits limits{};
    Particles particles;
    Tetrahedra cells;

    Samples(const Surface& surface, double edge, std::uint64_t seed = 1) {
        limits.tolerance = 0.1 * edge;
        limits.angle = 0.7;
        limits.min_edge = limits.max_edge = edge;
        Id next_id = 0;
        cover(particles, surface, CrossingGrid(surface), limits, seed, next_id);
        cells = tetrahedralise(particles.position);
    }
};

inline TriangleMesh mesh_of(const CarvedSurface& carved, const std::vector<Vec3>& points) {
    TriangleMesh mesh;
    std::size_t midpoint = 0;
    for (const int p : carved.particle)
        mesh.points.push_back(p >= 0 ? points[p] : carved.midpoints[midpoint++]);
    EXPECT_EQ(midpoint, carved.midpoints.size());
    mesh.triangles = carved.triangles;
    return mesh;
}

}  // namespace isotrack::support
