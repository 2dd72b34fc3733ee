// Meshes whose every property is known.
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "isotrack/types.h"

namespace isotrack::support {

inline TriangleMesh tetrahedron(const Vec3& corner = Vec3::Zero(), double size = 1.0) {
    TriangleMesh mesh;
    mesh.points = {corner, corner + size * Vec3::UnitX(), corner + size * Vec3::UnitY(),
                   corner + size * Vec3::UnitZ()};
    mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
    return mesh;
}

/// Both meshes in one, `b` after `a`, no vertex shared.
inline TriangleMesh join(TriangleMesh a, const TriangleMesh& b) {
    const int offset = static_cast<int>(a.points.size());
    a.points.insert(a.points.end(), b.points.begin(), b.points.end());
    for (const Triangle& t : b.triangles)
        a.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
    return a;
}

/// Every triangle that uses vertex `from` uses `to` instead.
inline TriangleMesh weld(TriangleMesh mesh, int from, int to) {
    for (Triangle& t : mesh.triangles)
        for (int& v : t)
            if (v == from) v = to;
    return mesh;
}

/// Around the z axis: `major` quads along, `minor` quads across, each split in two. Vertex (i, j) has index i
/// * minor + j.
inline TriangleMesh torus(int major, int minor, double R = 1.0, double r = 0.4) {
    const double kTurn = 2.0 * std::acos(-1.0);
    TriangleMesh mesh;
    for (int i = 0; i < major; ++i)
        for (int j = 0; j < minor; ++j) {
            const double u = kTurn * i / major, v = kTurn * j / minor;
            const double rho = R + r * std::cos(v);
            mesh.points.push_back({rho * std::cos(u), rho * std::sin(u), r * std::sin(v)});
        }
    const auto at = [&](int i, int j) { return (i % major) * minor + j % minor; };
    for (int i = 0; i < major; ++i)
        for (int j = 0; j < minor; ++j) {
            mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
            mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
        }
    return mesh;
}

/// An icosahedron refined `rounds` times: 20 * 4^rounds triangles, every vertex on the sphere.
inline TriangleMesh icosphere(int rounds, const Vec3& centre = Vec3::Zero(), double radius = 1.0) {
    const double g = (1.0 + std::sqrt(5.0)) / 2.0;
    TriangleMesh mesh;
    mesh.points = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                   {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
    mesh.triangles = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                      {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                      {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
    for (Vec3& p : mesh.points) p.normalize();
    for (int round = 0; round < rounds; ++round) {
        std::map<std::pair<int, int>, int> middle;
        const auto midpoint = [&](int a, int b) {
            const auto [it, fresh] =
                middle.try_emplace(std::minmax(a, b), static_cast<int>(mesh.points.size()));
            if (fresh) mesh.points.push_back((mesh.points[a] + mesh.points[b]).normalized());
            return it->second;
        };
        std::vector<Triangle> finer;
        for (const Triangle& t : mesh.triangles) {
            const int a = midpoint(t[0], t[1]), b = midpoint(t[1], t[2]), c = midpoint(t[2], t[0]);
            finer.insert(finer.end(), {{t[0], a, c}, {t[1], b, a}, {t[2], c, b}, {a, b, c}});
        }
        mesh.triangles = std::move(finer);
    }
    for (Vec3& p : mesh.points) p = centre + radius * p;
    return mesh;
}

/// Those whose boxes meet this one, by asking each.
inline std::vector<int> triangles_meeting(const Box& box, const TriangleMesh& mesh) {
    std::vector<int> result;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        Box own;
        for (const int v : mesh.triangles[t]) own.extend(mesh.points[v]);
        if (own.intersects(box)) result.push_back(static_cast<int>(t));
    }
    return result;
}

}  // namespace isotrack::support
