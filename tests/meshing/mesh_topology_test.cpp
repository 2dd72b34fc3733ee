#include "isotrack/meshing/mesh_topology.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <limits>
#include <random>
#include <set>

#include "isotrack/error.h"
#include "support/meshes.h"

namespace isotrack {
namespace {

TEST(MeshTopology, CountsATetrahedron) {
    const MeshTopology t = mesh_topology(support::tetrahedron());
    EXPECT_EQ(t.vertices, 4u);
    EXPECT_EQ(t.edges, 6u);
    EXPECT_EQ(t.triangles, 4u);
    EXPECT_EQ(t.components, 1u);
    EXPECT_EQ(t.euler, 2);
    EXPECT_EQ(t.genus(), 0);
    EXPECT_TRUE(t.closed());
    EXPECT_TRUE(t.oriented());
    EXPECT_TRUE(t.manifold());
}

TEST(MeshTopology, FindsTheGenusOfTori) {
    const TriangleMesh torus = support::torus(12, 7);
    EXPECT_EQ(mesh_topology(torus).genus(), 1);
    EXPECT_EQ(mesh_topology(torus).edges, 3u * 12u * 7u);
    const MeshTopology two = mesh_topology(support::join(torus, support::torus(5, 5)));
    EXPECT_EQ(two.components, 2u);
    EXPECT_EQ(two.genus(), 2);
    EXPECT_TRUE(two.closed() && two.oriented() && two.manifold());
}

TEST(MeshTopology, FindsAnEdgeSharedByTwoTetrahedra) {
    TriangleMesh mesh = support::join(support::tetrahedron(), support::tetrahedron());
    mesh = support::weld(support::weld(mesh, 4, 0), 5, 1);
    const MeshTopology t = mesh_topology(mesh);
    EXPECT_EQ(t.complex_edges, 1u);
    EXPECT_EQ(t.pinched_vertices, 0u);  // the complex edge holds the triangles of its ends together
    EXPECT_EQ(t.unused_vertices, 2u);
    EXPECT_EQ(t.edges, 11u);
    EXPECT_EQ(t.components, 1u);
    EXPECT_TRUE(t.closed());
    EXPECT_FALSE(t.manifold());
}

TEST(MeshTopology, FindsAVertexSharedByTwoTetrahedra) {
    const MeshTopology t =
        mesh_topology(support::weld(support::join(support::tetrahedron(), support::tetrahedron()), 4, 0));
    EXPECT_EQ(t.pinched_vertices, 1u);
    EXPECT_EQ(t.complex_edges, 0u);
    EXPECT_EQ(t.components, 1u);
    EXPECT_EQ(t.vertices, 7u);
    EXPECT_EQ(t.euler, 3);
    EXPECT_TRUE(t.closed());
    EXPECT_FALSE(t.manifold());
}

TEST(MeshTopology, FindsTheEdgesOfAFlippedFace) {
    TriangleMesh mesh = support::tetrahedron();
    std::swap(mesh.triangles[2][0], mesh.triangles[2][1]);
    const MeshTopology t = mesh_topology(mesh);
    EXPECT_EQ(t.flipped_edges, 3u);
    EXPECT_FALSE(t.oriented());
    EXPECT_TRUE(t.closed());
    EXPECT_TRUE(t.manifold());
}

TEST(MeshTopology, FindsTheBorderOfAnOpenFan) {
    TriangleMesh fan;
    const int blades = 40;  // more than the small-degree path takes
    fan.points.assign(blades + 2, Vec3::Zero());
    for (int i = 0; i < blades; ++i) fan.triangles.push_back({0, i + 1, i + 2});
    const MeshTopology t = mesh_topology(fan);
    EXPECT_EQ(t.border_edges, blades + 2u);
    EXPECT_EQ(t.edges, 2u * blades + 1u);
    EXPECT_EQ(t.pinched_vertices, 0u);
    EXPECT_EQ(t.euler, 1);
    EXPECT_FALSE(t.closed());
    EXPECT_TRUE(t.manifold());

    fan.triangles.erase(fan.triangles.begin() + 10);
    EXPECT_EQ(mesh_topology(fan).pinched_vertices, 1u);
}

TEST(MeshTopology, SetsDegenerateTrianglesAside) {
    TriangleMesh mesh = support::tetrahedron();
    mesh.points.push_back(Vec3::Ones());
    mesh.triangles.push_back({0, 1, 1});
    mesh.triangles.push_back({4, 4, 4});
    const MeshTopology t = mesh_topology(mesh);
    EXPECT_EQ(t.degenerate_triangles, 2u);
    EXPECT_EQ(t.triangles, 6u);
    EXPECT_EQ(t.edges, 6u);
    EXPECT_EQ(t.euler, 2);
    EXPECT_EQ(t.unused_vertices, 1u);
    EXPECT_TRUE(t.closed());
    EXPECT_FALSE(t.manifold());
}

TEST(MeshTopology, FindsNothingInAnEmptyMesh) {
    const MeshTopology t = mesh_topology({});
    EXPECT_EQ(t.vertices + t.edges + t.triangles + t.components, 0u);
    EXPECT_EQ(t.euler, 0);
    EXPECT_TRUE(t.closed() && t.oriented() && t.manifold());
}

TEST(MeshTopology, RefusesIndicesOutsideTheMesh) {
    TriangleMesh mesh = support::tetrahedron();
    mesh.triangles[3][1] = 4;
    EXPECT_THROW(mesh_topology(mesh), InputError);
    mesh.triangles[3][1] = -1;
    EXPECT_THROW(mesh_topology(mesh), InputError);
}

// The same counts by maps and sets, on soups in which every defect occurs.
MeshTopology counted_slowly(const TriangleMesh& mesh) {
    MeshTopology result;
    std::map<std::pair<int, int>, std::vector<bool>> uses;
    std::map<int, std::vector<Triangle>> around;
    for (const Triangle& t : mesh.triangles) {
        ++result.triangles;
        if (std::set<int>(t.begin(), t.end()).size() < 3) {
            ++result.degenerate_triangles;
            continue;
        }
        for (int k = 0; k < 3; ++k) {
            const int a = t[k], b = t[(k + 1) % 3];
            uses[std::minmax(a, b)].push_back(a < b);
            around[a].push_back(t);
        }
    }
    // Number of classes when items that share a vertex other than `except` are joined.
    const auto classes = [](const std::vector<Triangle>& items, int except) {
        std::vector<int> label(items.size());
        int count = 0;
        std::vector<std::size_t> open;
        for (std::size_t i = 0; i < items.size(); ++i) {
            if (label[i] != 0) continue;
            label[i] = ++count;
            open.push_back(i);
            while (!open.empty()) {
                const Triangle t = items[open.back()];
                open.pop_back();
                for (std::size_t j = 0; j < items.size(); ++j)
                    for (int v : items[j])
                        if (label[j] == 0 && v != except && std::count(t.begin(), t.end(), v) > 0) {
                            label[j] = count;
                            open.push_back(j);
                        }
            }
        }
        return static_cast<std::size_t>(count);
    };
    std::vector<Triangle> proper;
    for (const Triangle& t : mesh.triangles)
        if (std::set<int>(t.begin(), t.end()).size() == 3) proper.push_back(t);
    result.components = classes(proper, -1);
    result.vertices = around.size();
    result.unused_vertices = mesh.points.size() - around.size();
    result.edges = uses.size();
    for (const auto& [edge, directions] : uses) {
        result.border_edges += directions.size() == 1;
        result.complex_edges += directions.size() > 2;
        result.flipped_edges += directions.size() == 2 && directions[0] == directions[1];
    }
    for (const auto& [v, triangles] : around) result.pinched_vertices += classes(triangles, v) > 1;
    result.euler = static_cast<long>(result.vertices) - static_cast<long>(result.edges) +
                   static_cast<long>(proper.size());
    return result;
}

TEST(MeshTopology, AgreesWithSlowCountsOnRandomSoups) {
    std::mt19937 random(7);
    for (int round = 0; round < 300; ++round) {
        TriangleMesh mesh;
        const int points = 4 + round % 40, triangles = 1 + round % 120;
        mesh.points.assign(points, Vec3::Zero());
        for (int i = 0; i < triangles; ++i)
            mesh.triangles.push_back({static_cast<int>(random() % points),
                                      static_cast<int>(random() % points),
                                      static_cast<int>(random() % points)});
        const MeshTopology a = mesh_topology(mesh), b = counted_slowly(mesh);
        EXPECT_EQ(a.vertices, b.vertices);
        EXPECT_EQ(a.unused_vertices, b.unused_vertices);
        EXPECT_EQ(a.edges, b.edges);
        EXPECT_EQ(a.triangles, b.triangles);
        EXPECT_EQ(a.components, b.components);
        EXPECT_EQ(a.border_edges, b.border_edges);
        EXPECT_EQ(a.complex_edges, b.complex_edges);
        EXPECT_EQ(a.flipped_edges, b.flipped_edges);
        EXPECT_EQ(a.pinched_vertices, b.pinched_vertices);
        EXPECT_EQ(a.degenerate_triangles, b.degenerate_triangles);
        EXPECT_EQ(a.euler, b.euler);
    }
}

TEST(SmallestAngles, AreThoseOfKnownTriangles) {
    TriangleMesh mesh;
    const double height = std::sqrt(3.0) / 2.0;
    mesh.points = {{0, 0, 0}, {1, 0, 0}, {0.5, height, 0}, {0, 1, 0}, {0, 1e-9, 0}, {-5, 0, 0}, {2, 0, 0}};
    mesh.triangles = {{0, 1, 2}, {0, 1, 3}, {4, 1, 0}, {0, 1, 4}, {5, 4, 1}, {0, 1, 6}, {0, 1, 1}};
    const std::vector<double> angles = smallest_angles(mesh);
    ASSERT_EQ(angles.size(), mesh.triangles.size());
    const double kDegrees = 180.0 / std::acos(-1.0);
    EXPECT_NEAR(angles[0], 60.0, 1e-12);
    EXPECT_NEAR(angles[1], 45.0, 1e-12);
    EXPECT_NEAR(angles[2], 1e-9 * kDegrees, 1e-20);  // thin, and still to full precision
    EXPECT_NEAR(angles[3], 1e-9 * kDegrees, 1e-20);
    EXPECT_NEAR(angles[4], 0.2e-9 * kDegrees, 1e-20);
    EXPECT_EQ(angles[5], 0.0);
    EXPECT_EQ(angles[6], 0.0);
}

TEST(EnclosedVolume, IsPositiveOutwardAndKeepsItsDigitsFarAway) {
    EXPECT_NEAR(enclosed_volume(support::tetrahedron()), 1.0 / 6.0, 1e-16);
    EXPECT_NEAR(enclosed_volume(support::tetrahedron(Vec3::Constant(1048576.0))), 1.0 / 6.0, 1e-16);
    TriangleMesh inward = support::tetrahedron();
    for (Triangle& t : inward.triangles) std::swap(t[0], t[1]);
    EXPECT_NEAR(enclosed_volume(inward), -1.0 / 6.0, 1e-16);
    EXPECT_EQ(enclosed_volume({}), 0.0);
}

TEST(EnclosedVolume, HasTheSameBitsAtAnyThreadCount) {
    const TriangleMesh sphere = support::icosphere(5);
    const double many = enclosed_volume(sphere);
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    EXPECT_EQ(enclosed_volume(sphere), many);
    EXPECT_NEAR(many, 4.0 / 3.0 * std::acos(-1.0), 5e-3);
}

}  // namespace
}  // namespace isotrack
