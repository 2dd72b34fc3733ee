#include "surface/volume_to_mesh.h"

#include <openvdb/tools/VolumeToMesh.h>

#include <algorithm>
#include <utility>

namespace isotrack {

PolygonMesh volume_to_polygons(const openvdb::FloatGrid& grid, double adaptivity) {
    std::vector<openvdb::Vec3s> points;
    std::vector<openvdb::Vec3I> triangles;
    std::vector<openvdb::Vec4I> quads;
    openvdb::tools::volumeToMesh(grid, points, triangles, quads, 0.0, adaptivity);

    PolygonMesh mesh;
    mesh.points.reserve(points.size());
    for (const openvdb::Vec3s& p : points) mesh.points.emplace_back(p.x(), p.y(), p.z());
    const auto copy = [](const auto& from, auto& to) {
        to.resize(from.size());
        for (std::size_t i = 0; i < from.size(); ++i)
            for (std::size_t k = 0; k < to[i].size(); ++k)
                to[i][k] = static_cast<int>(from[i][static_cast<int>(k)]);
    };
    copy(triangles, mesh.triangles);
    copy(quads, mesh.quads);

    // OpenVDB winds the polygons of a level set clockwise seen from outside, those of any other class the
    // other way round, and does not look at whether the transform mirrors.
    const bool clockwise = grid.getGridClass() == openvdb::GRID_LEVEL_SET;
    const openvdb::Vec3d x =
        grid.indexToWorld(openvdb::Vec3d(1, 0, 0)) - grid.indexToWorld(openvdb::Vec3d(0, 0, 0));
    const openvdb::Vec3d y =
        grid.indexToWorld(openvdb::Vec3d(0, 1, 0)) - grid.indexToWorld(openvdb::Vec3d(0, 0, 0));
    const openvdb::Vec3d z =
        grid.indexToWorld(openvdb::Vec3d(0, 0, 1)) - grid.indexToWorld(openvdb::Vec3d(0, 0, 0));
    const bool mirrored = x.dot(y.cross(z)) < 0.0;
    if (clockwise != mirrored) {
        for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
        for (auto& q : mesh.quads) std::swap(q[1], q[3]);
    }
    return mesh;
}

}  // namespace isotrack
