// A part of a mesh exchanged for that of another mesh of the same surface.
#pragma once

#include <optional>
#include <vector>

#include "isotrack/types.h"
#include "meshing/triangle_bins.h"

namespace isotrack {

/// What goes and what comes.
struct Patch {
    std::vector<char> gone;           ///< Per triangle of the mesh.
    std::vector<Vec3> points;         ///< Numbered on from those of the mesh: all that come are among them.
    std::vector<Triangle> triangles;  ///< That come.
    long components = 0, euler = 0;   ///< How much more of them there are in what comes than in what goes.
};

/// The triangles of a mesh within `reach` of a place, and those around where their border would be pinched.
/// Ascending.
std::vector<int> triangles_around(const Vec3& place, double reach, const TriangleBins& mesh);

/// `gone`, with a border that is pinched nowhere, goes. The triangles of `fine` that are nearest to them
/// come, less a seam about `spacing` wide, the length of an edge there; strips of triangles fill the seam
/// from each loop of the one border to one of the other. nullopt where the loops do not match. Both meshes
/// must be closed and manifold (`fine` around what goes), and so is what they become, but for edges that it
/// may have twice; it may cross itself.
std::optional<Patch> patch_for(const std::vector<int>& gone, const TriangleBins& mesh,
                               const TriangleBins& fine, double spacing);

}  // namespace isotrack
