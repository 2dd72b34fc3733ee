// The topology of whole frames, on surfaces that are hard to hold: that of volumeToMesh, and where no part is
// thinner than two voxels that of the solid itself.
#include <gtest/gtest.h>
#include <openvdb/openvdb.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <ostream>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "isotrack/compare/baselines.h"
#include "isotrack/meshing/certify.h"
#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"
#include "isotrack/surface/level_set.h"
#include "isotrack/tracking/tracker.h"

namespace isotrack {
namespace {

constexpr int kHalf = 26;
constexpr double kBand = 3.0;

struct Solid {
    std::string name;
    std::function<double(const Vec3&)> distance;  // voxels, negative inside; a bound where it is no distance
    std::size_t components = 0;                   // 0: thinner than two voxels somewhere
    long euler = 0;
};
void PrintTo(const Solid& solid, std::ostream* out) {
    *out << solid.name;
}

double ball(const Vec3& p, double radius) {
    return p.norm() - radius;
}
double ring(const Vec3& p, int axis, double major, double minor) {
    const double height = p[axis], radius = std::hypot(p[(axis + 1) % 3], p[(axis + 2) % 3]);
    return std::hypot(radius - major, height) - minor;
}
double disk(const Vec3& p, double radius, double thickness) {
    const Vec3 normal = Vec3(0.3, 0.5, 0.8).normalized();
    const double height = p.dot(normal), beside = (p - height * normal).norm() - radius,
                 above = std::abs(height) - 0.5 * thickness;
    return beside > 0.0 && above > 0.0 ? std::hypot(beside, above) : std::max(beside, above);
}

/// Blobs and rods about three voxels thick and as far apart, where waves of all directions add up.
Solid noise(unsigned seed) {
    constexpr double kPi = 3.14159265358979323846, kWave = 6.0, kWaves = 24;
    std::mt19937 random(seed);
    const auto uniform = [&] { return random() / 4294967296.0; };
    std::vector<std::pair<Vec3, double>> waves;
    for (int i = 0; i < kWaves; ++i) {
        const double height = 2.0 * uniform() - 1.0, turn = 2.0 * kPi * uniform(),
                     beside = std::sqrt(1.0 - height * height);
        waves.emplace_back(2.0 * kPi / kWave * Vec3(beside * std::cos(turn), beside * std::sin(turn), height),
                           2.0 * kPi * uniform());
    }
    return {"noise_" + std::to_string(seed), [waves](const Vec3& p) {
                double sum = 0.0;
                for (const auto& [wave, phase] : waves) sum += std::cos(wave.dot(p) + phase);
                const double level = sum / std::sqrt(0.5 * kWaves);  // of variance 1
                return std::max((0.9 - level) * kWave / (2.0 * kPi) * std::sqrt(3.0), ball(p, 13.2));
            }};
}

std::vector<Solid> solids() {
    std::vector<Solid> result;
    result.push_back(
        {"nested_shells",
         [](const Vec3& p) {
             const double r = p.norm();
             return std::min({std::max(r - 21.3, 18.1 - r), std::max(r - 15.2, 12.4 - r), r - 8.6});
         },
         5, 10});
    for (const double thickness : {1.5, 2.2, 3.0})
        result.push_back({"plate_" + std::to_string(static_cast<int>(10 * thickness)),
                          [=](const Vec3& p) { return disk(p, 17.3, thickness); },
                          thickness > 2.0 ? std::size_t{1} : 0, 2});
    for (const double gap : {0.8, 2.3})
        result.push_back({"near_balls_" + std::to_string(static_cast<int>(10 * gap)),
                          [=](const Vec3& p) {
                              const Vec3 middle = (10.2 + 0.5 * gap) * Vec3(0.7, 0.5, 0.5).normalized();
                              return std::min(ball(p - middle, 10.2), ball(p + middle, 10.2));
                          },
                          gap > 2.0 ? std::size_t{2} : 0, 4});
    result.push_back({"wires",
                      [](const Vec3& p) {
                          return std::min({ring(p - Vec3(0.2, 0.1, 0.3), 0, 16.4, 1.15),
                                           ring(p - Vec3(8.7, 0.4, 0.2), 1, 11.2, 1.2),
                                           ring(p + Vec3(9.8, 0.3, 0.1), 2, 9.6, 1.1)});
                      },
                      0, 0});
    result.push_back(
        {"metaballs",
         [](const Vec3& p) {
             double sum = 0.0;
             for (const Vec3& at : {Vec3(-9, 1, 0), Vec3(8, -3, 2), Vec3(0, 11, -4), Vec3(1, -9, -7)})
                 sum += std::exp(-(p - at).squaredNorm() / 64.0);
             return sum > 0.0 ? std::min(8.0 * (0.35 - sum) / std::max(sum, 0.35), kBand) : kBand;
         },
         0, 0});
    result.push_back({"zalesak",
                      [](const Vec3& p) {
                          const double slot = std::max(std::abs(p.x() - 0.3) - 2.7, -p.y() - 8.2);
                          return std::max(ball(p, 16.6), -slot);
                      },
                      1, 2});
    result.push_back(
        {"truss",
         [](const Vec3& p) {
             double nearest = kBand;
             for (int axis = 0; axis < 3; ++axis)
                 for (const double u : {-9.3, 9.6})
                     for (const double w : {-9.4, 9.5}) {
                         const double from_axis = std::hypot(p[(axis + 1) % 3] - u, p[(axis + 2) % 3] - w);
                         nearest = std::min(nearest, std::max(from_axis - 1.4, std::abs(p[axis]) - 12.2));
                     }
             return nearest;
         },
         1, -8});
    for (const unsigned seed : {1u, 2u, 3u}) result.push_back(noise(seed));
    return result;
}

LevelSet grid_of(const Solid& solid) {
    auto grid = openvdb::FloatGrid::create(static_cast<float>(kBand));
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    auto values = grid->getAccessor();
    for (int x = -kHalf; x <= kHalf; ++x)
        for (int y = -kHalf; y <= kHalf; ++y)
            for (int z = -kHalf; z <= kHalf; ++z) {
                const double d = std::clamp(solid.distance(Vec3(x, y, z)), -kBand, kBand);
                if (std::abs(d) < kBand)
                    values.setValue({x, y, z}, static_cast<float>(d));
                else if (d < 0.0)
                    values.setValueOff({x, y, z}, static_cast<float>(d));
            }
    return LevelSet(grid);
}

/// The triangles at least half a voxel high that face away from the surface's normals, where it has any.
std::size_t facing_away(const TriangleMesh& mesh, const LevelSet& surface) {
    std::size_t count = 0;
    const auto probe = surface.probe();
    for (const auto& [i, j, k] : mesh.triangles) {
        const Vec3 &a = mesh.points[i], &b = mesh.points[j], &c = mesh.points[k];
        const Vec3 area = (b - a).cross(c - a), middle = (a + b + c) / 3.0;
        const double longest = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
        if (area.norm() < 0.5 * longest || probe->sample(middle).gradient.norm() < 0.6) continue;
        count += std::max({area.dot(probe->normal(middle)), area.dot(probe->normal(a)),
                           area.dot(probe->normal(b)), area.dot(probe->normal(c))}) < 0.0;
    }
    return count;
}

void expect_sound(const TriangleMesh& mesh, const MeshTopology& wanted) {
    const MeshTopology topology = mesh_topology(mesh);
    EXPECT_TRUE(topology.closed() && topology.oriented() && topology.manifold());
    EXPECT_EQ(topology.components, wanted.components);
    EXPECT_EQ(topology.euler, wanted.euler);
    EXPECT_TRUE(self_intersections(mesh).empty());
}

/// Tracks a surface that rests, cold and warm, with and without the fit; `expect(result, tracker, frame)`.
template <typename Expect>
void expect_in_two_frames(const LevelSet& surface, const MeshTopology& wanted, const Expect& expect) {
    for (const bool fit : {false, true}) {
        SCOPED_TRACE(fit ? "--fit" : "plain");
        TrackerOptions options;
        options.tolerance = 0.5;
        options.fit = fit;
        Tracker tracker(options);
        for (int frame = 0; frame < 2; ++frame) {
            const TrackedFrame result = tracker.advance(surface);
            expect_sound(result.mesh, wanted);
            expect(result, tracker, frame);
        }
    }
}

class Topology : public ::testing::TestWithParam<Solid> {};

TEST_P(Topology, IsThatOfTheLevelSet) {
    const LevelSet surface = grid_of(GetParam());
    const MeshTopology wanted = mesh_topology(volume_to_mesh(surface));
    if (GetParam().components > 0) {
        EXPECT_EQ(wanted.components, GetParam().components);
        EXPECT_EQ(wanted.euler, GetParam().euler);
    }
    expect_in_two_frames(surface, wanted, [&](const TrackedFrame& result, const Tracker&, int) {
        EXPECT_TRUE(result.within_tolerance) << result.max_error << ", lost " << result.lost_crossings;
        EXPECT_EQ(facing_away(result.mesh, surface), 0u);
    });
}

/// Nodes inside and outside at random: nothing that particles could follow.
TEST(TopologyOfNoise, IsThatOfTheLattice) {
    constexpr int kSide = 8;
    std::mt19937 random(3);
    const auto uniform = [&] { return random() / 4294967296.0; };
    auto grid = openvdb::FloatGrid::create(1.0f);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    auto values = grid->getAccessor();
    for (int x = -kSide; x <= kSide; ++x)
        for (int y = -kSide; y <= kSide; ++y)
            for (int z = -kSide; z <= kSide; ++z) {
                const bool border = std::max({std::abs(x), std::abs(y), std::abs(z)}) == kSide;
                const double size = 0.1 + 0.8 * uniform();
                values.setValue({x, y, z}, static_cast<float>(border || uniform() < 0.5 ? size : -size));
            }
    const LevelSet surface(grid);
    const MeshTopology wanted = mesh_topology(volume_to_mesh(surface));
    std::set<Id> ids;  // of all frames so far
    std::size_t vertices = 0;
    expect_in_two_frames(surface, wanted, [&](const TrackedFrame& result, const Tracker& tracker, int frame) {
        if (frame == 0) {
            ids.clear();
            vertices = 0;
        }
        EXPECT_EQ(result.lost_crossings, 0u);
        // No vertex stands on a particle, and none has the id of another.
        ids.insert(result.mesh.ids.begin(), result.mesh.ids.end());
        vertices += result.mesh.points.size();
        EXPECT_EQ(ids.size(), vertices);
        for (const Id id : tracker.particles().id) EXPECT_EQ(ids.count(id), 0u);
    });
}

/// A cube turned in space, with a ball beside it.
double turned_cube(const Vec3& p) {
    const Eigen::Matrix3d turn =
        (Eigen::AngleAxisd(0.5, Vec3::UnitX()) * Eigen::AngleAxisd(0.7, Vec3::UnitZ()) *
         Eigen::AngleAxisd(0.3, Vec3::UnitY()))
            .toRotationMatrix();
    const Vec3 out = (turn * p).cwiseAbs() - Vec3::Constant(11.4);
    const double cube = out.cwiseMax(0.0).norm() + std::min(out.maxCoeff(), 0.0);
    return std::min(cube, ball(p - Vec3(19.1, 14.2, -12.7), 4.3));
}

TEST(CoarseTolerance, KeepsTheDistanceFromEveryCrossing) {
    const LevelSet surface = grid_of({"turned_cube", turned_cube});
    for (const double tolerance : {1.0, 1.5, 2.0}) {
        SCOPED_TRACE(tolerance);
        TrackerOptions options;
        options.tolerance = tolerance;
        Tracker tracker(options);
        for (int frame = 0; frame < 2; ++frame) {
            const TrackedFrame result = tracker.advance(surface);
            EXPECT_TRUE(result.within_tolerance) << result.max_error;
            const MeshTopology topology = mesh_topology(result.mesh);
            EXPECT_TRUE(topology.closed() && topology.oriented() && topology.manifold());
            EXPECT_EQ(topology.components, 2u);
            EXPECT_EQ(topology.euler, 4);
            const CrossingGrid all(surface);
            const auto distances =
                crossing_distances(result.mesh.points, result.mesh.triangles, all, 2.0 * tolerance);
            EXPECT_LE(*std::max_element(distances.begin(), distances.end()), tolerance);
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Of, Topology, ::testing::ValuesIn(solids()),
                         [](const auto& solid) { return solid.param.name; });

}  // namespace
}  // namespace isotrack
