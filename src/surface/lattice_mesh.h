// The surface that parts the lattice nodes of a grid.
#pragma once

#include <algorithm>

#include "isotrack/surface/surface.h"
#include "surface/volume_to_mesh.h"

namespace isotrack {

/// The value of a lattice node, or another of its sign that keeps what passes next to the node at some
/// distance from it, by a fiftieth of `resolution` where values are distances.
template <typename Real>
Real off_node(Real value, Real resolution) {
    constexpr Real kLeast = Real(0.02);
    return value < 0 ? std::min(value, -kLeast * resolution) : std::max(value, kLeast * resolution);
}

/// From the quadrangles of volumeToMesh without adaptivity, of values `off_node`, one around every crossed
/// edge of `surface.lattice()`: each becomes eight triangles around that crossing. Its corners, one or more
/// in every cell that the surface passes through, go to the surface where they are alone in their cell and
/// the way there stays within it; its edges pass through the common face of two cells between the crossings
/// there. So no triangle leaves its cell, and only parts of the surface within one cell could cross [Ju and
/// Udeshi 2006, "Intersection-free contouring on an octree grid"], as they seldom do beside nodes with tiny
/// values.
TriangleMesh lattice_mesh_of(const PolygonMesh& quadrangles, const Surface& surface);

/// The same with fewer triangles: two of a quadrangle where they are within `close` of the crossing, four
/// around it where they are not, and more only where that keeps triangles from crossing. Empty where some
/// cross all the same.
TriangleMesh light_lattice_mesh_of(const PolygonMesh& quadrangles, const Surface& surface, double close);

/// The quadrangles with a corner in a cube around a place, `reach` to each side.
PolygonMesh quadrangles_near(const std::vector<Vec3>& places, double reach, const PolygonMesh& quadrangles);

}  // namespace isotrack
