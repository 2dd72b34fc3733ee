// How far points of a surface are from a mesh, and then from meshes a little different from it.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "isotrack/meshing/manifold.h"
#include "isotrack/surface/crossing_grid.h"
#include "isotrack/types.h"
#include "tracking/facets.h"

namespace isotrack {

/// From the mesh before to this.
struct FacetChanges {
    std::vector<Facet> came, went;
    bool many = false;             ///< So many that all distances had better be measured again.
    std::vector<Triangle> around;  ///< If not: those of this mesh that may be nearest now to what was nearest
                                   ///< to one that went.
};

/// The triangles in a box around `went` that reaches so far beyond it.
std::vector<Triangle> triangles_near_gone(const std::vector<Facet>& went, double reach,
                                          const std::vector<Vec3>& vertices,
                                          const std::vector<Triangle>& triangles);

class MeshDistances {
public:
    /// Distances as those of `crossing_distances`, with its `cutoff`. `points` must outlive it.
    MeshDistances(const CrossingGrid& points, double cutoff)
        : points_(points), cutoff_(cutoff), reach_(cutoff) {}

    void forget() { distances_ = std::vector<float>(); }  // there are many
    /// `changes`: since the mesh measured last, if there is one, with the triangles within two cutoffs
    /// around. Returns the points whose distances may be others now, each at least once; nullopt: all.
    std::optional<std::vector<int>> measure(const std::vector<Vec3>& vertices,
                                            const std::vector<Triangle>& triangles,
                                            const FacetChanges& changes);

    struct Survey {
        std::vector<int> beyond;  ///< The points farther than a limit, lost ones among them; ascending.
        std::size_t lost = 0;     ///< Those beyond the cutoff.
        double farthest = 0.0;    ///< Of those that are not lost.
        double sum_of_squares = 0.0,
               weight = 0.0;  ///< Of these, each counted as many times as it stands for.
    };
    /// Remembers the farthest: the next `measure` after some changes looks no farther.
    Survey survey(double limit);

    const CrossingGrid& points() const { return points_; }
    double operator[](std::size_t point) const { return distances_[point]; }

private:
    const CrossingGrid& points_;
    const double cutoff_;
    std::vector<float> distances_;  // empty: not measured yet
    // The farthest that the last survey found, if none was lost and nothing was measured since; else the
    // cutoff.
    double reach_;
};

}  // namespace isotrack
