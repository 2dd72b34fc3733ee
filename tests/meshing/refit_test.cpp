// Refits of meshes whose creases are known.
#include "isotrack/meshing/refit.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"
#include "isotrack/surface/shapes.h"
#include "support/meshes.h"

namespace isotrack {
namespace {

constexpr double kTolerance = 0.2;

/// The cube from -1 to 1, each side as n by n squares of two triangles.
TriangleMesh cube(int n) {
    TriangleMesh mesh;
    std::map<std::array<int, 3>, int> number;
    const auto vertex = [&](int axis, int side, int i, int j) {
        std::array<int, 3> at{};
        at[axis] = side * n;
        at[(axis + 1) % 3] = i;
        at[(axis + 2) % 3] = j;
        const auto [found, fresh] = number.emplace(at, static_cast<int>(mesh.points.size()));
        if (fresh) mesh.points.push_back(Vec3(at[0], at[1], at[2]) * (2.0 / n) - Vec3::Ones());
        return found->second;
    };
    for (int axis = 0; axis < 3; ++axis)
        for (int side = 0; side < 2; ++side)
            for (int i = 0; i < n; ++i)
                for (int j = 0; j < n; ++j) {
                    const int a = vertex(axis, side, i, j), b = vertex(axis, side, i + 1, j),
                              c = vertex(axis, side, i + 1, j + 1), d = vertex(axis, side, i, j + 1);
                    for (Triangle t : {Triangle{a, b, c}, Triangle{a, c, d}}) {
                        if (side == 0) std::swap(t[1], t[2]);
                        mesh.triangles.push_back(t);
                    }
                }
    return mesh;
}

std::set<std::pair<int, int>> edges_of(const TriangleMesh& mesh) {
    std::set<std::pair<int, int>> edges;
    for (const Triangle& t : mesh.triangles)
        for (int k = 0; k < 3; ++k) edges.emplace(std::minmax(t[k], t[(k + 1) % 3]));
    return edges;
}

/// On how many sides of the cube a point is.
int sides_at(const Vec3& p) {
    return static_cast<int>(((p.array().abs() - 1.0).abs() < 1e-9).count());
}

bool lie_in_one_side(const TriangleMesh& mesh, const Triangle& t) {
    return sides_at((mesh.points[t[0]] + mesh.points[t[1]] + mesh.points[t[2]]) / 3.0) > 0;
}

/// Takes the edges along the creases for the ones across, as many as have no corner in common with another.
int cut_creases(TriangleMesh& mesh) {
    std::map<std::pair<int, int>, int> triangle;  // by directed edge
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
        for (int k = 0; k < 3; ++k)
            triangle[{mesh.triangles[t][k], mesh.triangles[t][(k + 1) % 3]}] = static_cast<int>(t);
    const auto third = [&](int t, int v, int w) {
        const Triangle& of = mesh.triangles[t];
        return of[0] + of[1] + of[2] - v - w;
    };
    std::vector<char> touched(mesh.points.size(), 0);
    int cuts = 0;
    for (const auto& [edge, t] : triangle) {
        const auto [v, w] = edge;
        if (v > w || sides_at(0.5 * (mesh.points[v] + mesh.points[w])) < 2) continue;
        const int other = triangle.at({w, v}), a = third(t, v, w), d = third(other, v, w);
        if (touched[v] || touched[w] || touched[a] || touched[d]) continue;
        if (sides_at(mesh.points[a]) > 1 || sides_at(mesh.points[d]) > 1) continue;
        mesh.triangles[t] = {a, v, d};
        mesh.triangles[other] = {a, d, w};
        for (const int u : {v, w, a, d}) touched[u] = 1;
        ++cuts;
    }
    return cuts;
}

std::size_t count_cut(const TriangleMesh& mesh) {
    return std::count_if(mesh.triangles.begin(), mesh.triangles.end(),
                         [&](const Triangle& t) { return !lie_in_one_side(mesh, t); });
}

void expect_sound(const TriangleMesh& mesh) {
    const MeshTopology topology = mesh_topology(mesh);
    EXPECT_TRUE(topology.closed() && topology.manifold() && topology.oriented());
    EXPECT_EQ(topology.euler, 2);
}

double smallest_angle(const TriangleMesh& mesh) {
    double least = 180.0;
    for (const Triangle& t : mesh.triangles)
        for (int k = 0; k < 3; ++k) {
            const Vec3 u = (mesh.points[t[(k + 1) % 3]] - mesh.points[t[k]]).normalized(),
                       w = (mesh.points[t[(k + 2) % 3]] - mesh.points[t[k]]).normalized();
            least = std::min(least, std::acos(std::clamp(u.dot(w), -1.0, 1.0)) * 180.0 / std::acos(-1.0));
        }
    return least;
}

/// A cube with cuts across its creases, and its surface.
struct CutCube : ::testing::Test {
    const shapes::SurfacePtr box = shapes::box({0, 0, 0}, {1, 1, 1}, 0.1);
    TriangleMesh whole = cube(8), before = whole, after;
    int cuts = cut_creases(before);
    std::vector<std::array<int, 2>> flips;
    void refit_all(bool movable) {
        after = before;
        flips = refit(after.points, after.triangles, *box, kTolerance,
                      std::vector<char>(after.points.size(), movable));
    }
};

TEST_F(CutCube, GetsItsCreasesBack) {
    ASSERT_GT(cuts, 10);
    ASSERT_EQ(count_cut(whole), 0u);
    ASSERT_EQ(count_cut(before), 2u * static_cast<std::size_t>(cuts));
    refit_all(true);
    EXPECT_GE(flips.size(), static_cast<std::size_t>(cuts));
    expect_sound(after);
    EXPECT_TRUE(self_intersections(after).empty());
    double farthest = 0.0;
    const auto probe = box->probe();
    for (const auto& [i, j, k] : after.triangles)
        farthest = std::max(
            farthest, std::abs(probe->value((after.points[i] + after.points[j] + after.points[k]) / 3.0)));
    EXPECT_LT(farthest, 0.01);  // a cut triangle's centre was 0.08 inside
    EXPECT_GE(smallest_angle(after), std::min(30.0, smallest_angle(before)) - 1e-6);
}

TEST_F(CutCube, KeepsWhatIsNotMovable) {
    refit_all(false);
    EXPECT_TRUE(flips.empty());
    EXPECT_EQ(after.points, before.points);
    EXPECT_EQ(after.triangles, before.triangles);
}

TEST_F(CutCube, KeepsTrianglesAroundFixedVertices) {
    // At random, so that many an edge has such a triangle on one side alone.
    std::mt19937 random(1);
    std::vector<char> movable;
    for (std::size_t v = 0; v < before.points.size(); ++v) movable.push_back(random() % 8 != 0);
    after = before;
    ASSERT_FALSE(refit(after.points, after.triangles, *box, kTolerance, movable).empty());
    for (std::size_t t = 0; t < before.triangles.size(); ++t) {
        const auto& [i, j, k] = before.triangles[t];
        if (movable[i] && movable[j] && movable[k]) continue;
        EXPECT_EQ(after.triangles[t], before.triangles[t]);
    }
    for (std::size_t v = 0; v < before.points.size(); ++v)
        EXPECT_TRUE(movable[v] || after.points[v] == before.points[v]);
}

TEST_F(CutCube, MakesNoEdgeThatItHadAndEachFlipCanBeTakenBackAlone) {
    refit_all(true);
    ASSERT_GT(flips.size(), 4u);
    const auto at_start = edges_of(before), now = edges_of(after);
    std::size_t made = 0;
    for (const auto& edge : now) made += at_start.count(edge) == 0;
    EXPECT_EQ(made, flips.size());  // each flip made one
    std::set<int> flipped;
    bool back = false;
    for (const auto& [t, u] : flips) {
        EXPECT_TRUE(flipped.insert(t).second && flipped.insert(u).second);
        back = !back;
        if (!back) continue;  // every second one
        after.triangles[t] = before.triangles[t];
        after.triangles[u] = before.triangles[u];
    }
    expect_sound(after);
}

TEST_F(CutCube, IsTheSameAtAnyThreadCount) {
    refit_all(true);
    const TriangleMesh many = after;
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    refit_all(true);
    EXPECT_EQ(after.points, many.points);
    EXPECT_EQ(after.triangles, many.triangles);
}

/// A long prism whose upper edge, along x, has an interior angle of 2 `half_angle_deg`; in the middle that
/// edge is cut by one between its sides.
struct CutRidge : ::testing::TestWithParam<double> {
    static constexpr int kSegments = 6, kCut = kSegments / 2;
    const double half_angle = GetParam() * std::acos(-1.0) / 180.0;
    const Vec3 down{0.0, std::sin(half_angle), -std::cos(half_angle)};  // along one of the sides
    const shapes::SurfacePtr prism = shapes::from_function(
        [this](const Vec3& p) {
            const double side = std::abs(p.y()) * -down.z() + p.z() * down.y();
            return std::max({side, down.z() - p.z(), -p.x(), p.x() - kSegments});
        },
        Box(Vec3(-1, -2, -2), Vec3(kSegments + 1, 2, 1)), 0.1);
    TriangleMesh mesh;
    int ridge(int i) const { return 3 * i; }

    CutRidge() {
        const Vec3 up(1, -1, 1);  // to the other side
        for (int i = 0; i <= kSegments; ++i)
            for (const Vec3& p : {Vec3(Vec3::Zero()), down, Vec3(down.cwiseProduct(up))})
                mesh.points.push_back(Vec3(i, 0, 0) + p);
        for (int i = 0; i < kSegments; ++i)
            for (int k = 0; k < 3; ++k) {
                const int a = 3 * i + k, b = 3 * i + (k + 1) % 3, c = a + 3, d = b + 3;
                mesh.triangles.push_back({a, d, b});
                mesh.triangles.push_back({a, c, d});
            }
        mesh.triangles.push_back({0, 1, 2});
        mesh.triangles.push_back({3 * kSegments, 3 * kSegments + 2, 3 * kSegments + 1});
    }
    bool has_ridge() const { return edges_of(mesh).count(std::minmax(ridge(kCut), ridge(kCut + 1))) > 0; }
    void cut() {
        std::vector<int> beside, third;
        for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
            const Triangle& of = mesh.triangles[t];
            for (int k = 0; k < 3; ++k) {
                const std::pair<int, int> edge = std::minmax(of[k], of[(k + 1) % 3]);
                if (edge != std::pair{ridge(kCut), ridge(kCut + 1)}) continue;
                beside.push_back(static_cast<int>(t));
                third.push_back(of[(k + 2) % 3]);
                if (beside.size() == 2) {
                    const int v = of[k], w = of[(k + 1) % 3], d = third[1], a = third[0];
                    mesh.triangles[beside[0]] = {v, a, d};
                    mesh.triangles[beside[1]] = {a, w, d};
                    return;
                }
            }
        }
    }
};

TEST_P(CutRidge, IsMendedHoweverSharpItIs) {
    ASSERT_TRUE(has_ridge());
    expect_sound(mesh);
    ASSERT_GT(enclosed_volume(mesh), 0.0);
    cut();
    ASSERT_FALSE(has_ridge());
    expect_sound(mesh);
    const auto flips =
        refit(mesh.points, mesh.triangles, *prism, kTolerance, std::vector<char>(mesh.points.size(), 1));
    EXPECT_GE(flips.size(), 1u);
    EXPECT_TRUE(has_ridge());
    expect_sound(mesh);
}

INSTANTIATE_TEST_SUITE_P(HalfAngles, CutRidge, ::testing::Values(20.0, 30.0, 45.0, 60.0));

TEST(Refit, LeavesASphereAsSoundAndNearer) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    TriangleMesh mesh = support::icosphere(2);
    const auto volume_gap = [&] {
        double six = 0.0;
        for (const auto& [i, j, k] : mesh.triangles)
            six += mesh.points[i].dot(mesh.points[j].cross(mesh.points[k]));
        return std::abs(six / 6.0 - 4.0 / 3.0 * std::acos(-1.0));
    };
    const double before = volume_gap();
    refit(mesh.points, mesh.triangles, *sphere, kTolerance, std::vector<char>(mesh.points.size(), 1));
    expect_sound(mesh);
    EXPECT_LT(volume_gap(), 0.1 * before);
    EXPECT_GE(smallest_angle(mesh), 30.0 - 1e-6);
}

}  // namespace
}  // namespace isotrack
