#include "isotrack/compare/baselines.h"

#include <string>
#include <utility>

#include "isotrack/error.h"
#include "surface/volume_to_mesh.h"

namespace isotrack {

TriangleMesh volume_to_mesh(const LevelSet& level_set, double adaptivity) {
    if (!(adaptivity >= 0.0 && adaptivity <= 1.0))
        throw OptionError("adaptivity must be from 0 to 1, got " + std::to_string(adaptivity));
    PolygonMesh polygons = volume_to_polygons(*level_set.grid(), adaptivity);
    TriangleMesh mesh;
    mesh.points = std::move(polygons.points);
    mesh.triangles = std::move(polygons.triangles);
    mesh.triangles.reserve(mesh.triangles.size() + 2 * polygons.quads.size());
    for (const auto& q : polygons.quads) {
        const auto length2 = [&](int i, int j) {
            return (mesh.points[q[i]] - mesh.points[q[j]]).squaredNorm();
        };
        if (length2(0, 2) <= length2(1, 3)) {
            mesh.triangles.push_back({q[0], q[1], q[2]});
            mesh.triangles.push_back({q[0], q[2], q[3]});
        } else {
            mesh.triangles.push_back({q[0], q[1], q[3]});
            mesh.triangles.push_back({q[1], q[2], q[3]});
        }
    }
    return mesh;
}

}  // namespace isotrack
