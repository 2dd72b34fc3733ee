// Pairs of triangles that cross.
#pragma once

#include <utility>
#include <vector>

#include "isotrack/types.h"

namespace isotrack {

/// Pairs (i < j, ascending) of triangles that share more than their common vertices and edges, decided
/// exactly (CGAL). Vertices at the same place count as common, so that the copies that keep a mesh manifold
/// do not intersect each other by touching. Neighbours folded onto each other and a triangle given twice are
/// pairs. Triangles without area take no part: in a closed mesh the neighbours on their edges touch what they
/// touch. About 0.6 us per triangle and core; uses TBB inside. \throws InputError for a vertex that is not
/// finite, or a triangle with an index outside `points`.
std::vector<std::pair<int, int>> self_intersections(const std::vector<Vec3>& points,
                                                    const std::vector<Triangle>& triangles);
/// The same for a mesh.
inline std::vector<std::pair<int, int>> self_intersections(const TriangleMesh& mesh) {
    return self_intersections(mesh.points, mesh.triangles);
}

/// Whether a triangle of `some` makes a pair with another of them or with one of `others`. For a few in
/// `some`: compares all with all of those and of what is near them.
bool any_cross(const std::vector<Vec3>& points, const std::vector<Triangle>& some,
               const std::vector<Triangle>& others);

/// Flags for those of `others` that make a pair with one of `some`. Points must be finite. Uses TBB inside; a
/// thread that waits there takes up nothing else meanwhile.
std::vector<char> crossed_by(const std::vector<Vec3>& points, const std::vector<Triangle>& some,
                             const std::vector<Triangle>& others);

}  // namespace isotrack
