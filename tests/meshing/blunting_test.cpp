// Blunting of meshes whose sharp triangles are known.
#include "isotrack/meshing/blunting.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include "isotrack/meshing/certify.h"
#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"
#include "isotrack/surface/shapes.h"
#include "support/meshes.h"

namespace isotrack {
namespace {

double smallest_angle(const std::vector<Vec3>& points, const Triangle& t) {
    double least = 180.0;
    for (int k = 0; k < 3; ++k) {
        const Vec3 u = (points[t[(k + 1) % 3]] - points[t[k]]).normalized(),
                   w = (points[t[(k + 2) % 3]] - points[t[k]]).normalized();
        least = std::min(least, std::acos(std::clamp(u.dot(w), -1.0, 1.0)) * 180.0 / std::acos(-1.0));
    }
    return least;
}

/// A unit sphere with vertices thrown about on it.
TriangleMesh rough_sphere() {
    TriangleMesh mesh = support::icosphere(3);
    for (std::size_t v = 0; v < mesh.points.size(); ++v) {
        const double a = 1.7 * static_cast<double>(v);
        mesh.points[v] =
            (mesh.points[v] + 0.05 * Vec3(std::cos(a), std::sin(2 * a), std::sin(a))).normalized();
    }
    return mesh;
}

std::vector<char> all_of(const TriangleMesh& mesh, bool movable) {
    return std::vector<char>(mesh.points.size(), movable);
}

std::size_t count_sharp(const TriangleMesh& mesh) {
    return std::count_if(mesh.triangles.begin(), mesh.triangles.end(),
                         [&](const Triangle& t) { return smallest_angle(mesh.points, t) < 30.0; });
}

double least_angle(const TriangleMesh& mesh) {
    double least = 180.0;
    for (const Triangle& t : mesh.triangles) least = std::min(least, smallest_angle(mesh.points, t));
    return least;
}

void expect_sound(const TriangleMesh& mesh, const Surface& surface, double tolerance) {
    const MeshTopology topology = mesh_topology(mesh);
    EXPECT_TRUE(topology.closed() && topology.manifold() && topology.oriented());
    EXPECT_EQ(topology.euler, 2);
    EXPECT_TRUE(self_intersections(mesh).empty());
    for (const TriangleError& e : triangle_errors(mesh.points, mesh.triangles, surface, 6))
        EXPECT_LE(e.largest, tolerance);
}

constexpr int kPasses = 4;
constexpr double kTolerance = 0.05;

/// The mesh of the tests, as it was and as it becomes.
struct RoughSphere : ::testing::Test {
    const shapes::SurfacePtr sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    const CrossingGrid crossings{*sphere};
    const std::vector<const CrossingGrid*> reached{&crossings};
    const TriangleMesh before = rough_sphere();
    TriangleMesh after = before;
    Blunter blunter(bool movable) {
        return {after.points, after.triangles, all_of(after, movable), *sphere, reached, kTolerance};
    }
};

TEST_F(RoughSphere, GetsBlunterTrianglesAndStaysSound) {
    Blunter blunter = this->blunter(true);
    ASSERT_TRUE(blunter.run(kPasses));
    ASSERT_GT(count_sharp(before), 20u);
    EXPECT_LT(count_sharp(after), count_sharp(before) / 4);
    EXPECT_GT(least_angle(after), 1.5 * least_angle(before));
    expect_sound(after, *sphere, kTolerance);
    std::size_t flips = 0, moves = 0;
    for (const Blunting& change : blunter.changes()) ++(change.vertex < 0 ? flips : moves);
    EXPECT_GT(flips, 0u);
    EXPECT_GT(moves, 0u);
    std::size_t left_surface = 0;  // for triangles below 18 degrees
    for (std::size_t v = 0; v < after.points.size(); ++v) {
        if (after.points[v] == before.points[v]) continue;
        EXPECT_NEAR(after.points[v].norm(), 1.0, kTolerance);
        left_surface += std::abs(after.points[v].norm() - 1.0) > 1e-6;
        for (int k = 0; k < 3; ++k) {
            const volatile float single = static_cast<float>(after.points[v][k]);
            EXPECT_EQ(after.points[v][k], static_cast<double>(single));
        }
    }
    EXPECT_LT(left_surface, moves / 4);
}

TEST(Blunter, KeepsTheHeightAboveTheSurface) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    const CrossingGrid crossings(*sphere);
    const std::vector<const CrossingGrid*> reached{&crossings};
    TriangleMesh mesh = rough_sphere();
    for (Vec3& p : mesh.points) p *= 1.02;
    const auto before = mesh.points;
    Blunter blunter(mesh.points, mesh.triangles, all_of(mesh, true), *sphere, reached, kTolerance);
    ASSERT_TRUE(blunter.run(kPasses));
    EXPECT_NE(mesh.points, before);
    for (const Vec3& p : mesh.points) EXPECT_NEAR(p.norm(), 1.02, 1e-6);
}

TEST_F(RoughSphere, KeepsWhatIsNotMovableWhereItIs) {
    Blunter blunter = this->blunter(false);
    ASSERT_TRUE(blunter.run(kPasses));
    EXPECT_EQ(after.points, before.points);
    EXPECT_LT(count_sharp(after), count_sharp(before));
    expect_sound(after, *sphere, kTolerance);
}

TEST(Blunter, LeavesAMeshWithoutSharpTrianglesAlone) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    const CrossingGrid crossings(*sphere);
    const std::vector<const CrossingGrid*> reached{&crossings};
    TriangleMesh mesh = support::icosphere(2);
    const TriangleMesh before = mesh;
    Blunter blunter(mesh.points, mesh.triangles, all_of(mesh, true), *sphere, reached, kTolerance);
    EXPECT_FALSE(blunter.run(kPasses));
    EXPECT_EQ(mesh.triangles, before.triangles);
    EXPECT_EQ(mesh.points, before.points);
}

TEST(Blunter, KeepsTheTolerance) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    const CrossingGrid crossings(*sphere);
    const std::vector<const CrossingGrid*> reached{&crossings};
    const TriangleMesh before = rough_sphere();
    double largest = 0.0;
    for (const TriangleError& e : triangle_errors(before.points, before.triangles, *sphere, 6))
        largest = std::max(largest, e.largest);
    TriangleMesh strict = before, loose = before;
    Blunter strictly(strict.points, strict.triangles, all_of(strict, true), *sphere, reached, 0.5 * largest);
    Blunter loosely(loose.points, loose.triangles, all_of(loose, true), *sphere, reached, 2.0 * largest);
    ASSERT_TRUE(strictly.run(kPasses));
    ASSERT_TRUE(loosely.run(kPasses));
    EXPECT_LT(strictly.changes().size(), loosely.changes().size());
    std::set<int> changed;
    for (const Blunting& change : strictly.changes())
        changed.insert(change.triangle.begin(), change.triangle.end());
    constexpr double kPrecision = 1.02;  // of errors between samples
    for (const int t : changed)
        EXPECT_LE(triangle_errors(strict.points, {strict.triangles[t]}, *sphere, 6)[0].largest,
                  kPrecision * 0.5 * largest);
}

TEST(Blunter, KeepsTheToleranceAsItIsCertified) {
    // Ripples with several maxima in a triangle, which the three intervals per edge that are looked at first
    // do not come near to: certifying then looks again.
    constexpr double kRipple = 0.012, kCertifiedTolerance = 0.016;
    const auto rippled = shapes::from_function(
        [](const Vec3& p) { return p.norm() - 1.0 - kRipple * (60.0 * p.array()).sin().prod(); },
        Box(Vec3::Constant(-1.1), Vec3::Constant(1.1)), 0.1);
    const CrossingGrid crossings(*rippled);
    const std::vector<const CrossingGrid*> reached{&crossings};
    TriangleMesh mesh = rough_sphere();
    Blunter blunter(mesh.points, mesh.triangles, all_of(mesh, true), *rippled, reached, kCertifiedTolerance);
    ASSERT_TRUE(blunter.run(kPasses));
    EXPECT_GT(blunter.changes().size(), 50u);
    const auto errors = certified_errors(mesh.points, mesh.triangles, *rippled, rippled->resolution(),
                                         0.6 * kCertifiedTolerance);
    for (const Blunting& change : blunter.changes())
        for (const int t : change.triangle) EXPECT_LE(errors[t].largest, kCertifiedTolerance);
}

TEST(Blunter, StaysAsNearToTheCrossings) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    const TriangleMesh before = rough_sphere();
    // Above every triangle one that it is just near enough to.
    std::vector<Surface::Crossing> above, also_above;
    for (const auto& [i, j, k] : before.triangles) {
        const Vec3 &a = before.points[i], &b = before.points[j], &c = before.points[k];
        const Vec3 normal = (b - a).cross(c - a).normalized();
        (above.size() > also_above.size() ? also_above : above)
            .push_back({(a + b + c) / 3.0 + 0.95 * kTolerance * normal, normal.cast<float>()});
    }
    const CrossingGrid crossings(above, 0.1), more(also_above, 0.1);
    const std::vector<const CrossingGrid*> reached{&crossings, &more};
    TriangleMesh after = before;
    Blunter blunter(after.points, after.triangles, all_of(after, true), *sphere, reached, kTolerance);
    ASSERT_TRUE(blunter.run(kPasses));
    for (const CrossingGrid* points : reached)
        for (const double d : crossing_distances(after.points, after.triangles, *points, 1.0))
            EXPECT_LE(d, kTolerance * (1.0 + 1e-7));  // a float
}

TEST(Blunter, CrossesNoOtherPartOfTheMesh) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    const CrossingGrid crossings(*sphere);
    const std::vector<const CrossingGrid*> reached{&crossings};
    TriangleMesh free = rough_sphere();
    Blunter unhindered(free.points, free.triangles, all_of(free, false), *sphere, reached, kTolerance);
    ASSERT_TRUE(unhindered.run(1));
    // A crumb on the new diagonal of the first flip.
    const auto first = unhindered.changes()[0];
    const Triangle t = first.before[0], u = first.before[1];
    const auto has = [](const Triangle& triangle, int v) {
        return std::find(triangle.begin(), triangle.end(), v) != triangle.end();
    };
    Vec3 middle = Vec3::Zero();  // of the new diagonal
    for (const int v : t)
        if (!has(u, v)) middle += 0.5 * free.points[v];
    for (const int v : u)
        if (!has(t, v)) middle += 0.5 * free.points[v];
    double apart = 1.0;  // from the planes of the triangles as they were
    for (const Triangle& old : {t, u}) {
        const Vec3& p = free.points[old[0]];
        const Vec3 normal = (free.points[old[1]] - p).cross(free.points[old[2]] - p).normalized();
        apart = std::min(apart, std::abs(normal.dot(middle - p)));
    }
    ASSERT_GT(apart, 1e-6);
    const double size = 0.2 * apart;
    TriangleMesh mesh =
        support::join(rough_sphere(), support::tetrahedron(middle - Vec3::Constant(0.25 * size), size));
    ASSERT_TRUE(self_intersections(mesh).empty());
    Blunter blunter(mesh.points, mesh.triangles, all_of(mesh, false), *sphere, reached, kTolerance);
    ASSERT_TRUE(blunter.run(1));
    EXPECT_TRUE(self_intersections(mesh).empty());
    for (const Blunting& change : blunter.changes()) EXPECT_NE(change.triangle, first.triangle);
}

TEST_F(RoughSphere, IsTheSameAtAnyNumberOfThreads) {
    // Many sharp triangles are beside each other here, so that one has to wait for another.
    std::vector<TriangleMesh> made;
    for (const std::size_t threads : {1, 2, 4}) {
        const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
        after = before;
        tbb::task_arena(static_cast<int>(threads)).execute([&] { blunter(true).run(3 * kPasses); });
        made.push_back(after);
    }
    EXPECT_NE(made[0].triangles, before.triangles);
    EXPECT_NE(made[0].points, before.points);
    for (const TriangleMesh& other : made) {
        EXPECT_EQ(other.triangles, made[0].triangles);
        EXPECT_EQ(other.points, made[0].points);
    }
}

TEST_F(RoughSphere, LosesWhatIsNearAPlaceAndNothingElse) {
    Blunter blunter = this->blunter(true);
    ASSERT_TRUE(blunter.run(kPasses));
    const std::size_t changes = blunter.changes().size();
    ASSERT_GT(changes, 10u);
    const int t = blunter.changes()[0].triangle[0];
    const Vec3 place = after.points[after.triangles[t][0]];
    ASSERT_TRUE(blunter.undo_near({place}, 1e-9));
    EXPECT_LT(blunter.changes().size(), changes);
    EXPECT_GT(blunter.changes().size(), changes / 2);
    expect_sound(after, *sphere, kTolerance);
    EXPECT_EQ(after.triangles[t], before.triangles[t]);
    for (const int v : after.triangles[t]) {
        bool moved_later = false;
        for (const Blunting& change : blunter.changes()) moved_later = moved_later || change.vertex == v;
        if (!moved_later) {
            EXPECT_EQ(after.points[v], before.points[v]);
        }
    }
    // A place that no change is near: all go.
    while (!blunter.changes().empty()) ASSERT_TRUE(blunter.undo_near({Vec3(9, 9, 9)}, 1.0));
    EXPECT_EQ(after.triangles, before.triangles);
    EXPECT_EQ(after.points, before.points);
    EXPECT_FALSE(blunter.undo_near({Vec3(9, 9, 9)}, 1.0));
}

TEST_F(RoughSphere, StaysAManifoldWhateverIsTakenBack) {
    std::mt19937 random(7);
    std::normal_distribution<double> off(0.0, 0.03);
    int tried = 0, taken_back = 0;
    for (int attempt = 0; attempt < 20; ++attempt) {
        after = support::icosphere(3);
        for (Vec3& p : after.points) p = (p + Vec3(off(random), off(random), off(random))).normalized();
        if (!self_intersections(after).empty()) continue;
        ++tried;
        const TriangleMesh at_first = after;
        Blunter blunter = this->blunter(true);
        const auto expect_before = [&] {
            const auto [points, triangles] = blunter.before();
            EXPECT_EQ(points, at_first.points);
            EXPECT_EQ(triangles, at_first.triangles);
        };
        for (int round = 0; round < 6; ++round) {
            blunter.run(kPasses);
            expect_before();
            for (int place = 0; place < 5; ++place) {
                const Vec3 at = Vec3(off(random), off(random), off(random)).normalized();
                const std::size_t changes = blunter.changes().size();
                blunter.undo_near({at}, 0.05);
                taken_back += blunter.changes().size() < changes;
                const MeshTopology topology = mesh_topology(after);
                ASSERT_TRUE(topology.closed() && topology.manifold() && topology.oriented()) << attempt;
            }
            expect_before();
        }
    }
    EXPECT_GT(tried, 5);
    EXPECT_GT(taken_back, 100);
}

}  // namespace
}  // namespace isotrack
