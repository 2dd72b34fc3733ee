// A frame's mesh as it is worked on.
#pragma once

#include <cstddef>
#include <vector>

#include "isotrack/meshing/manifold.h"

namespace isotrack {

struct FrameMesh {
    CarvedSurface carved;
    std::vector<Vec3> vertices;  ///< Of the mesh: fitted when asked for.
};

/// Where its vertices are before a fit: on particles, which are in these places, or on midpoints, as floats
/// hold them.
std::vector<Vec3> unfitted_vertices(const CarvedSurface& carved, const std::vector<Vec3>& particles);

/// The Euler number of a closed mesh: three halves of an edge for each triangle.
inline long euler_of(const FrameMesh& mesh) {
    return static_cast<long>(mesh.vertices.size()) - static_cast<long>(mesh.carved.triangles.size() / 2);
}

/// The vertex on each of so many particles; negative if there is none or several.
std::vector<int> lone_vertices(const FrameMesh& mesh, std::size_t particles);
/// Flags for these, per vertex: the others are copies, and what stands on no particle.
std::vector<char> lone_flags(const FrameMesh& mesh, const std::vector<int>& lone_vertices);

/// Whether a triangle is on another diagonal than the facet of the DT in whose place it is.
bool is_flipped(const CarvedSurface& carved, std::size_t triangle, const Tetrahedra& cells);

/// The mesh less the flagged triangles and the vertices that none has then.
FrameMesh without(FrameMesh mesh, const std::vector<char>& left_out);

/// Adds vertices that stand on no particle, and triangles, which are no facets.
void append(FrameMesh& mesh, const std::vector<Vec3>& points, const std::vector<Triangle>& triangles);

}  // namespace isotrack
