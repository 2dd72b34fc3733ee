// The surface that parts the lattice nodes of a grid.
#pragma once

#include "isotrack/surface/surface.h"
#include "surface/volume_to_mesh.h"

namespace isotrack {

/// From the quadrangles of volumeToMesh without adaptivity, one around every crossed edge of
/// `surface.lattice()`: each becomes eight triangles around that crossing. Its corners, one or more in every
/// cell that the surface passes through, go to the surface where they are alone in their cell and the way
/// there stays within it; its edges pass through the common face of two cells between the crossings there. So
/// no triangle leaves its cell, and only parts of the surface within one cell may cross [Ju and Udeshi 2006,
/// "Intersection-free contouring on an octree grid"]: beside a node whose value is next to nothing they do.
TriangleMesh lattice_mesh_of(const PolygonMesh& quadrangles, const Surface& surface);

/// The quadrangles with a corner in a cube around a place, `reach` to each side.
PolygonMesh quadrangles_near(const std::vector<Vec3>& places, double reach, const PolygonMesh& quadrangles);

}  // namespace isotrack
