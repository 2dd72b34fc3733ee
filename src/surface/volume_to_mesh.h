// The meshes of OpenVDB's volumeToMesh, wound as ours are.
#pragma once

#include <openvdb/openvdb.h>

#include <array>
#include <vector>

#include "isotrack/types.h"

namespace isotrack {

/// World units; polygons counter-clockwise seen from outside.
struct PolygonMesh {
    std::vector<Vec3> points;
    std::vector<Triangle> triangles;
    std::vector<std::array<int, 4>> quads;
};

/// `adaptivity`: 0 to 1; without it there are no triangles, and a quadrangle around every crossed edge.
PolygonMesh volume_to_polygons(const openvdb::FloatGrid& grid, double adaptivity);

}  // namespace isotrack
