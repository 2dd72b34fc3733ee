// Where a mesh may miss the surface between lattice crossings although it reaches them.
#pragma once

#include <atomic>
#include <cstddef>
#include <vector>

#include "isotrack/meshing/manifold.h"
#include "surface/cell_points.h"
#include "tracking/mesh_distances.h"

namespace isotrack {

class BetweenCrossings {
public:
    /// `surface` and `crossings`, some or all of its own, must outlive it. `diagonals`: all of the surface.
    BetweenCrossings(const Surface& surface, const CrossingGrid& crossings,
                     const std::vector<Surface::Diagonal>& diagonals, double tolerance)
        : surface_(surface),
          crossings_(crossings),
          tolerance_(tolerance),
          cells_(surface, crossings, diagonals) {}

    /// Points of the surface beside crossings that the mesh only just reaches: near its folds, the sharper
    /// the sooner, those with up to half a spacing of the crossings to spare, since from a fold what lies
    /// between two crossings may be much farther than either, but fewer where the surface is flat. Where some
    /// crossings stand for others: those others, all along folded triangles, with no direction: a triangle
    /// may stand for them whichever way it faces. Else points in cells, of those with an ambiguous face in
    /// all. What was returned before is left out.
    PackedCrossings points(const std::vector<Vec3>& vertices, const std::vector<Triangle>& triangles,
                           const MeshDistances& at_crossings);

    /// What has changed since a mesh was looked at last.
    struct Changes {
        std::size_t triangles = 0;             ///< So many came or went.
        std::vector<Eigen::Vector3f> corners;  ///< Of those that came.
        std::vector<int> crossings;            ///< Whose distances may be others, each at least once.
    };
    /// The same of a mesh that differs by so much from the one looked at last.
    PackedCrossings points_near(const Changes& changes, const std::vector<Vec3>& vertices,
                                const std::vector<Triangle>& triangles, const MeshDistances& at_crossings);

private:
    using Flags = std::vector<std::atomic<char>>;
    /// Flags the crossings that are nearly too far off for a fold at these triangles.
    void flag_at_folds(const std::vector<Triangle>& triangles, const std::vector<float>& turns,
                       const std::vector<Vec3>& vertices, const MeshDistances& at_crossings,
                       Flags& at_fold) const;
    /// Whether it is looked at from now on, and was not before.
    bool take_doubtful(std::size_t crossing, const MeshDistances& at_crossings, const Flags& at_fold);
    PackedCrossings points_beside(const std::vector<int>& doubtful);

    const Surface& surface_;
    const CrossingGrid& crossings_;
    const double tolerance_;
    CellPoints cells_;
    std::vector<char> looked_at_;  // per crossing
};

}  // namespace isotrack
