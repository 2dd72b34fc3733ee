// What users would take instead of isotrack, beyond volumeToMesh: to be measured beside it.
#pragma once

#include <cstddef>
#include <vector>

#include "isotrack/surface/level_set.h"
#include "isotrack/types.h"

namespace isotrack::bench {

/// OpenMesh's quadric decimation to at most `triangles`, as far as legal collapses go.
TriangleMesh decimate(const TriangleMesh& mesh, std::size_t triangles);

/// CGAL's isotropic remeshing, five iterations, projected back on `mesh`.
/// \throws InputError for a mesh that is not closed, oriented and manifold.
TriangleMesh remesh(const TriangleMesh& mesh, double edge);

/// CGAL's Delaunay refinement of an implicit surface, make_surface_mesh: angles of 30 degrees at least, the
/// distance bound alone decides the size, closed manifold. Asks the level set for values, as isotrack does.
class ImplicitMesher {
public:
    /// `uniform`: a mesh of the level set, from which the first points are taken in every component: CGAL's
    /// own way, rays from the centre of a sphere, needs a centre inside and misses components. Both must
    /// outlive this.
    ImplicitMesher(const LevelSet& level_set, const TriangleMesh& uniform);

    /// `distance`: between facet and surface at the facet's centre, world units.
    /// \throws Error when the refinement does not end.
    TriangleMesh mesh(double distance) const;

private:
    const LevelSet& level_set_;
    const TriangleMesh& uniform_;
    std::vector<std::vector<int>> components_;  ///< Vertices of `uniform_`.
};

}  // namespace isotrack::bench
