#include "isotrack/compare/baselines.h"

#include <openvdb/tools/VolumeToMesh.h>

#include <string>
#include <utility>

#include "isotrack/error.h"

namespace isotrack {

TriangleMesh volume_to_mesh(const LevelSet& level_set, double adaptivity) {
    if (!(adaptivity >= 0.0 && adaptivity <= 1.0))
        throw OptionError("adaptivity must be from 0 to 1, got " + std::to_string(adaptivity));

    std::vector<openvdb::Vec3s> points;
    std::vector<openvdb::Vec3I> triangles;
    std::vector<openvdb::Vec4I> quads;
    const openvdb::FloatGrid& grid = *level_set.grid();
    openvdb::tools::volumeToMesh(grid, points, triangles, quads, 0.0, adaptivity);

    TriangleMesh mesh;
    mesh.points.reserve(points.size());
    for (const openvdb::Vec3s& p : points) mesh.points.emplace_back(p.x(), p.y(), p.z());
    mesh.triangles.reserve(triangles.size() + 2 * quads.size());
    const auto add = [&](unsigned a, unsigned b, unsigned c) {
        mesh.triangles.push_back({static_cast<int>(a), static_cast<int>(b), static_cast<int>(c)});
    };
    for (const openvdb::Vec3I& t : triangles) add(t[0], t[1], t[2]);
    for (const openvdb::Vec4I& q : quads) {
        const auto length2 = [&](int i, int j) {
            return (mesh.points[q[i]] - mesh.points[q[j]]).squaredNorm();
        };
        if (length2(0, 2) <= length2(1, 3)) {
            add(q[0], q[1], q[2]);
            add(q[0], q[2], q[3]);
        } else {
            add(q[0], q[1], q[3]);
            add(q[1], q[2], q[3]);
        }
    }

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
    if (clockwise != mirrored)
        for (Triangle& t : mesh.triangles) std::swap(t[1], t[2]);
    return mesh;
}

}  // namespace isotrack
