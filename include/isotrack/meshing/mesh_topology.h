// What a triangle mesh is, combinatorially and in shape.
#pragma once

#include <cstddef>
#include <vector>

#include "isotrack/types.h"

namespace isotrack {

/// What the vertex indices alone say. A degenerate triangle counts in `triangles` and `degenerate_triangles`;
/// all else is said of the mesh without it.
struct MeshTopology {
    std::size_t vertices = 0;  ///< Used by a triangle.
    std::size_t unused_vertices = 0;
    std::size_t edges = 0, triangles = 0, components = 0;  ///< Components joined through shared vertices.
    std::size_t border_edges = 0;                          ///< Edges of one triangle.
    std::size_t complex_edges = 0;                         ///< Edges of three or more triangles.
    std::size_t flipped_edges = 0;     ///< Edges of two triangles that run along them in the same direction.
    std::size_t pinched_vertices = 0;  ///< Vertices whose triangles form more than one fan.
    std::size_t degenerate_triangles = 0;  ///< A vertex index twice.
    long euler = 0;                        ///< V - E + F over the used vertices.

    bool closed() const { return border_edges == 0; }
    bool oriented() const { return flipped_edges == 0; }
    bool manifold() const { return complex_edges == 0 && pinched_vertices == 0 && degenerate_triangles == 0; }
    /// Sum over the components of a closed manifold: (2 components - euler) / 2.
    long genus() const { return (2 * static_cast<long>(components) - euler) / 2; }
};

/// O(n), about 0.1 us per triangle where neighbours lie close in memory; uses TBB inside.
/// \throws InputError for a triangle with an index outside `points`.
MeshTopology mesh_topology(const TriangleMesh& mesh);

/// Smallest interior angle of each triangle, in the mesh's order, degrees; 0 for one without area. Indices
/// must be valid.
std::vector<double> smallest_angles(const TriangleMesh& mesh);

/// Signed volume enclosed, world units cubed; positive when oriented outward. The same bits at any thread
/// count.
double enclosed_volume(const TriangleMesh& mesh);

}  // namespace isotrack
