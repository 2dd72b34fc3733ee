// How far a mesh is from a level set, and what kind of mesh it is.
#pragma once

#include <cstddef>

#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/surface/level_set.h"
#include "isotrack/types.h"

namespace isotrack {

/// Distances in voxels of the level set. "To": from the mesh to the level set, |phi| at 28 points of each
/// triangle (a regular lattice of barycentric coordinates in sixths, corners included), RMS weighted by area;
/// where the level set's `reach()` ends it tells no more. "From": from the level set to the
/// mesh, the distance to the nearest triangle of every lattice edge crossing, projected on the surface. The
/// symmetric error is the larger of both.
struct MeshMetrics {
    MeshTopology topology;
    std::size_t self_intersections = 0;  ///< Pairs of triangles.
    double to_max = 0.0, to_rms = 0.0;
    double from_max = 0.0, from_rms = 0.0;
    /// Facet normal against O2 at the centroid; the mean weighted by area.
    double normal_max_deg = 0.0, normal_mean_deg = 0.0;
    /// Smallest angle of each triangle: the least, the 1 % quantile, the mean.
    double min_angle_deg = 0.0, angle_p1_deg = 0.0, mean_min_angle_deg = 0.0;
    double volume = 0.0;  ///< World units cubed.

    double error_max() const { return to_max > from_max ? to_max : from_max; }
};

/// Triangles without area weigh nothing. Infinite `from` when the level set has a
/// surface and the mesh has no triangle. Thread-safe; uses TBB inside; the same bits at any thread count.
/// \throws InputError for a triangle with an index outside `points` or a vertex that is not finite.
MeshMetrics measure(const TriangleMesh& mesh, const LevelSet& level_set);

}  // namespace isotrack
