// A part of a mesh exchanged for that of another mesh of the same surface.
#pragma once

#include <optional>
#include <vector>

#include "isotrack/types.h"

namespace isotrack {

/// What goes and what comes.
struct Patch {
    std::vector<char> gone;           ///< Per triangle of the mesh.
    std::vector<Vec3> points;         ///< Vertices that come, numbered on from those of the mesh.
    std::vector<Triangle> triangles;  ///< That come.
    long euler = 0;                   ///< How much they raise the Euler number.
};

/// The triangles of a mesh within `reach` of a place go. Those of `fine` that are nearest to them come, less
/// a seam about `spacing` wide, the length of an edge there; strips of triangles fill the seam from each loop
/// of the one border to one of the other. nullopt where the loops do not match. Both meshes must be closed
/// and manifold, and so is what they become, but for edges that it may have twice; it may cross itself.
std::optional<Patch> patch_around(const Vec3& place, double reach, const std::vector<Vec3>& points,
                                  const std::vector<Triangle>& triangles, const TriangleMesh& fine,
                                  double spacing);

}  // namespace isotrack
