// What the last mesh says about its particles, for when there is no DT of where they are now.
#pragma once

#include <cstddef>
#include <vector>

#include "isotrack/delaunay/tetrahedralisation.h"
#include "isotrack/meshing/manifold.h"
#include "isotrack/sampling/adjacency.h"
#include "isotrack/sampling/particles.h"
#include "isotrack/sampling/sizing.h"

namespace isotrack {

/// The triangles as particle indices, without those that stand on a midpoint.
std::vector<Triangle> particle_triangles(const CarvedSurface& carved);

/// Entries follow those of the particles, with which they are to be kept in step.
struct LastMesh {
    Adjacency ring;  ///< Along the mesh.
    std::vector<Triangle> triangles;
    SizingEvidence evidence;

    /// From now on it is this mesh; the evidence stays. The ring is left empty: it takes memory, and is of
    /// use when particles move.
    void take(std::vector<Triangle> of_mesh);
    /// The same, and the thickness at its particles by the DT it was carved from: the distance to the nearest
    /// Delaunay neighbour that faces the other way.
    void take(const CarvedSurface& carved, const Particles& particles, const Tetrahedra& cells);
    void make_ring(std::size_t particles);
    /// Only the particles whose flag is set are left.
    void retain(const std::vector<char>& keep);
    /// Particle i becomes that of order[i].
    void reorder(const std::vector<int>& order);
    /// Particles were added, so many there are now: `parents` are the triangles that the last ones were born
    /// in; about the others nothing is known.
    void grow(std::size_t particles, const std::vector<Triangle>& parents = {});
};

}  // namespace isotrack
