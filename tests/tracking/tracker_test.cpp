#include "isotrack/tracking/tracker.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <set>

#include "isotrack/error.h"
#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"
#include "isotrack/surface/shapes.h"

namespace isotrack {
namespace {

constexpr double kVoxel = 0.04, kTolerance = 0.02;

TrackerOptions options() {
    TrackerOptions o;
    o.tolerance = kTolerance;
    return o;
}

/// Largest |value| at 66 points of every triangle.
double distance_to(const Surface& surface, const TriangleMesh& mesh) {
    const auto probe = surface.probe();
    double largest = 0.0;
    for (const Triangle& t : mesh.triangles)
        for (int i = 0; i <= 10; ++i)
            for (int j = 0; i + j <= 10; ++j) {
                const Vec3 &a = mesh.points[t[0]], &b = mesh.points[t[1]], &c = mesh.points[t[2]];
                largest =
                    std::max(largest, std::abs(probe->value(a + 0.1 * i * (b - a) + 0.1 * j * (c - a))));
            }
    return largest;
}

void expect_sound(const TriangleMesh& mesh, std::size_t components, long euler) {
    const MeshTopology t = mesh_topology(mesh);
    EXPECT_TRUE(t.closed());
    EXPECT_TRUE(t.oriented());
    EXPECT_TRUE(t.manifold());
    EXPECT_EQ(t.unused_vertices, 0u);
    EXPECT_EQ(t.components, components);
    EXPECT_EQ(t.euler, euler);
    EXPECT_TRUE(self_intersections(mesh).empty());
    EXPECT_EQ(std::set<Id>(mesh.ids.begin(), mesh.ids.end()).size(), mesh.points.size());
}

double kept(const std::set<Id>& before, const Particles& now) {
    std::size_t n = 0;
    for (const Id id : now.id) n += before.count(id);
    return static_cast<double>(n) / static_cast<double>(before.size());
}

std::set<Id> ids_of(const Particles& particles) {
    return {particles.id.begin(), particles.id.end()};
}

TEST(Tracker, KeepsATranslatingSphereWithinTheToleranceAndItsIds) {
    Tracker tracker(options());
    std::set<Id> before;
    for (int frame = 0; frame < 6; ++frame) {
        const auto sphere = shapes::sphere(Vec3(0.03 * frame, 0.0, 0.0), 0.6, kVoxel);
        const TrackedFrame result = tracker.advance(*sphere);
        expect_sound(result.mesh, 1, 2);
        EXPECT_LE(distance_to(*sphere, result.mesh),
                  kTolerance * 1.02);  // sampled more finely than the tracker does
        EXPECT_TRUE(result.within_tolerance);
        if (frame > 0) {
            EXPECT_GE(kept(before, tracker.particles()), 0.9);
        }
        before = ids_of(tracker.particles());
    }
}

TEST(Tracker, GivesEveryShapeItsTopology) {
    const auto near = shapes::unite(
        {shapes::sphere(Vec3(-0.44, 0, 0), 0.4, kVoxel), shapes::sphere(Vec3(0.44, 0, 0), 0.4, kVoxel)});
    const struct {
        shapes::SurfacePtr shape;
        std::size_t components;
        long euler;
    } cases[] = {{shapes::torus(Vec3::Zero(), 0.7, 0.25, kVoxel), 1, 0},
                 {shapes::shell(Vec3::Zero(), 0.8, 0.12, kVoxel), 2, 4},
                 {shapes::plate(Vec3::Zero(), 0.7, 0.09, kVoxel), 1, 2},
                 {shapes::box(Vec3::Zero(), Vec3(0.5, 0.4, 0.3), kVoxel), 1, 2},
                 {near, 2, 4}};
    for (const auto& c : cases) {
        SCOPED_TRACE(&c - cases);
        const TrackedFrame result = Tracker(options()).advance(*c.shape);
        expect_sound(result.mesh, c.components, c.euler);
        EXPECT_LE(distance_to(*c.shape, result.mesh), kTolerance * 1.02);
    }
}

TEST(Tracker, FollowsMergeSplitBirthAndDeath) {
    Tracker tracker(options());
    const auto pair = [](double gap) {
        return shapes::unite({shapes::sphere(Vec3(-0.4 - gap, 0, 0), 0.4, kVoxel),
                              shapes::sphere(Vec3(0.4 + gap, 0, 0), 0.4, kVoxel)});
    };
    expect_sound(tracker.advance(*pair(0.1)).mesh, 2, 4);
    expect_sound(tracker.advance(*pair(-0.1)).mesh, 1, 2);
    expect_sound(tracker.advance(*pair(0.1)).mesh, 2, 4);
    const auto with_drop = shapes::unite({pair(0.1), shapes::sphere(Vec3(0, 1, 0), 0.1, kVoxel)});
    const TrackedFrame born = tracker.advance(*with_drop);
    expect_sound(born.mesh, 3, 6);
    EXPECT_GT(born.seeded, 0u);
    expect_sound(tracker.advance(*pair(0.1)).mesh, 2, 4);
}

TEST(Tracker, AllowsEmptyFramesAndNeverReusesAnId) {
    Tracker tracker(options());
    const auto sphere = shapes::sphere(Vec3::Zero(), 0.4, kVoxel);
    tracker.advance(*sphere);
    const std::set<Id> first = ids_of(tracker.particles());
    const auto nothing =
        shapes::from_function([](const Vec3&) { return 1.0; }, Box(Vec3(-1, -1, -1), Vec3(1, 1, 1)), kVoxel);
    EXPECT_TRUE(tracker.advance(*nothing).mesh.empty());
    EXPECT_EQ(tracker.particles().size(), 0u);
    expect_sound(tracker.advance(*sphere).mesh, 1, 2);
    for (const Id id : tracker.particles().id) EXPECT_EQ(first.count(id), 0u);
}

TEST(Tracker, ReportsTheDisplacementAsVelocity) {
    Tracker tracker(options());
    const Vec3 shift(0.05, 0.02, 0.0);
    Tracker::Motion motion = [&](const Vec3& p) { return Vec3(p + shift); };
    tracker.advance(*shapes::sphere(Vec3::Zero(), 0.5, kVoxel));
    const TrackedFrame result = tracker.advance(*shapes::sphere(shift, 0.5, kVoxel), motion);
    // Relaxation may slide a particle by a fraction of its spacing; on the whole they move with the sphere.
    Vec3 mean = Vec3::Zero();
    for (const Vec3& v : result.mesh.velocities)
        mean += v / static_cast<double>(result.mesh.velocities.size());
    EXPECT_LT((mean - shift).norm(), 0.1 * shift.norm());
}

TEST(Tracker, GivesTheSameMeshAtAnyThreadCount) {
    const auto run = [] {
        TrackerOptions o = options();
        o.fit = true;
        Tracker tracker(o);
        tracker.advance(*shapes::torus(Vec3::Zero(), 0.6, 0.25, kVoxel));
        return tracker.advance(*shapes::torus(Vec3(0.02, 0, 0.03), 0.6, 0.25, kVoxel)).mesh;
    };
    const TriangleMesh many = run();
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
    const TriangleMesh one = run();
    EXPECT_EQ(one.points, many.points);
    EXPECT_EQ(one.triangles, many.triangles);
    EXPECT_EQ(one.ids, many.ids);
}

TEST(Tracker, FitsWithFewerTrianglesAndAVolumeTenTimesBetter) {
    const auto sphere = shapes::sphere(Vec3::Zero(), 0.8, kVoxel);
    const double truth = 4.0 / 3.0 * std::acos(-1.0) * 0.8 * 0.8 * 0.8;
    const TrackedFrame plain = Tracker(options()).advance(*sphere);
    TrackerOptions o = options();
    o.fit = true;
    const TrackedFrame fitted = Tracker(o).advance(*sphere);
    expect_sound(fitted.mesh, 1, 2);
    EXPECT_LE(distance_to(*sphere, fitted.mesh), kTolerance * 1.02);
    EXPECT_LT(fitted.mesh.triangles.size(), plain.mesh.triangles.size());
    EXPECT_LT(std::abs(enclosed_volume(fitted.mesh) - truth),
              0.1 * std::abs(enclosed_volume(plain.mesh) - truth));
}

TEST(Tracker, SamplesAsInThePaper) {
    TrackerOptions o = options();
    o.method = Method::Paper;
    Tracker tracker(o);
    // An ellipsoid: the density must follow the curvature.
    const auto ellipsoid = shapes::ellipsoid(Vec3::Zero(), Vec3(1.0, 0.4, 0.4), kVoxel);
    expect_sound(tracker.advance(*ellipsoid).mesh, 1, 2);
    double tip = 0.0, waist = 0.0;
    int tips = 0, waists = 0;
    for (std::size_t i = 0; i < tracker.particles().size(); ++i) {
        const double x = std::abs(tracker.particles().position[i].x());
        if (x > 0.9) tip += tracker.particles().spacing[i], ++tips;
        if (x < 0.2) waist += tracker.particles().spacing[i], ++waists;
    }
    ASSERT_GT(tips, 0);
    ASSERT_GT(waists, 0);
    EXPECT_LT(tip / tips, 0.8 * waist / waists);
}

TEST(Tracker, RefusesOptionsOutsideTheirRange) {
    TrackerOptions o;
    EXPECT_THROW(Tracker{o}, OptionError);  // no tolerance
    o = options();
    o.tolerance = std::nan("");
    EXPECT_THROW(Tracker{o}, OptionError);
    o = options();
    o.angle_deg = 120.0;
    EXPECT_THROW(Tracker{o}, OptionError);
    o = options();
    o.min_edge = 0.2;
    o.max_edge = 0.1;
    EXPECT_THROW(Tracker{o}, OptionError);
}

}  // namespace
}  // namespace isotrack
