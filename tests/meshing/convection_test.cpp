// Which cells of a DT are inside.
#include "isotrack/meshing/convection.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "isotrack/meshing/certify.h"
#include "isotrack/meshing/manifold.h"
#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/surface/shapes.h"
#include "support/samples.h"
#include "support/solid.h"

namespace isotrack {
namespace {

using support::expect_solid;
using support::mesh_of;
using support::Samples;

constexpr double kPi = 3.14159265358979323846;

TriangleMesh guided_mesh(const Surface& surface, double edge, std::uint64_t seed = 1) {
    const Samples s(surface, edge, seed);
    const auto labels = guided_convection(s.cells, s.particles.position, s.particles.normal, surface);
    return mesh_of(carve(s.cells, labels, s.particles.position), s.particles.position);
}

TEST(GuidedConvection, GivesOneSphere) {
    for (const std::uint64_t seed : {1u, 2u, 3u}) {
        const auto mesh = guided_mesh(*shapes::sphere({0.1, 0.2, -0.3}, 1.0, 0.05), 0.15, seed);
        expect_solid(mesh, 1, 2);
        // Inscribed: below the ball by about edge^2 / 4 of the volume.
        EXPECT_LT(enclosed_volume(mesh), 4.0 / 3.0 * kPi);
        EXPECT_GT(enclosed_volume(mesh), 4.0 / 3.0 * kPi * (1.0 - 0.15 * 0.15));
    }
}

TEST(GuidedConvection, KeepsTheHoleOfATorus) {
    expect_solid(guided_mesh(*shapes::torus({0, 0, 0}, 1.0, 0.3, 0.05), 0.1), 1, 0);
}

TEST(GuidedConvection, OpensTheVoidOfAShell) {
    const auto mesh = guided_mesh(*shapes::shell({0, 0, 0}, 1.0, 0.3, 0.05), 0.12);
    expect_solid(mesh, 2, 4);
    EXPECT_NEAR(enclosed_volume(mesh), 4.0 / 3.0 * kPi * (1.0 - 0.343), 0.05);
}

TEST(GuidedConvection, OpensShellsWithinShells) {
    // Three solids, one in the other: surfaces of radius 1, 0.85, 0.7, 0.55 and 0.4.
    const auto surface =
        shapes::unite({shapes::shell({0, 0, 0}, 1.0, 0.15, 0.05), shapes::shell({0, 0, 0}, 0.7, 0.15, 0.05),
                       shapes::sphere({0, 0, 0}, 0.4, 0.05)});
    const auto mesh = guided_mesh(*surface, 0.08);
    expect_solid(mesh, 5, 10);
    const double cubes = 1.0 - std::pow(0.85, 3) + std::pow(0.7, 3) - std::pow(0.55, 3) + std::pow(0.4, 3);
    EXPECT_NEAR(enclosed_volume(mesh), 4.0 / 3.0 * kPi * cubes, 0.03);
}

TEST(GuidedConvection, KeepsTwoNearSpheresApart) {
    const auto surface =
        shapes::unite({shapes::sphere({-0.52, 0, 0}, 0.5, 0.02), shapes::sphere({0.52, 0, 0}, 0.5, 0.02)});
    expect_solid(guided_mesh(*surface, 0.04), 2, 4);
}

TEST(GuidedConvection, KeepsAThinPlateWhole) {
    const auto mesh = guided_mesh(*shapes::plate({0, 0, 0}, 1.0, 0.06, 0.02), 0.05);
    expect_solid(mesh, 1, 2);
    EXPECT_NEAR(enclosed_volume(mesh), kPi * 0.06, 0.02);
}

TEST(GuidedConvection, ClosesABoxWithSharpEdges) {
    const auto mesh = guided_mesh(*shapes::box({0, 0, 0}, {0.5, 0.4, 0.3}, 0.03), 0.06);
    expect_solid(mesh, 1, 2);
    EXPECT_NEAR(enclosed_volume(mesh), 8.0 * 0.5 * 0.4 * 0.3, 0.03);
}

TEST(GuidedConvection, LeavesInfiniteCellsOutsideAtAnyThreadCount) {
    const auto surface = shapes::torus({0, 0, 0}, 1.0, 0.3, 0.05);
    const Samples s(*surface, 0.1);
    const auto labels = guided_convection(s.cells, s.particles.position, s.particles.normal, *surface);
    ASSERT_EQ(labels.size(), s.cells.size());
    for (std::size_t c = 0; c < s.cells.size(); ++c)
        if (s.cells.is_infinite(static_cast<int>(c))) {
            EXPECT_EQ(labels[c], 0);
        }
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    EXPECT_EQ(guided_convection(s.cells, s.particles.position, s.particles.normal, *surface), labels);
}

TEST(PureConvection, FindsTheSurfaceFromTheParticlesAlone) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.05),
               torus = shapes::torus({0, 0, 0}, 1.0, 0.4, 0.05);
    const Samples a(*sphere, 0.12), b(*torus, 0.08);
    expect_solid(mesh_of(carve(a.cells, pure_convection(a.cells, a.particles.position), a.particles.position),
                         a.particles.position),
                 1, 2);
    const auto mesh =
        mesh_of(carve(b.cells, pure_convection(b.cells, b.particles.position), b.particles.position),
                b.particles.position);
    EXPECT_NEAR(enclosed_volume(mesh), 2.0 * kPi * kPi * 0.16, 0.1);
    EXPECT_EQ(mesh_topology(mesh).euler, 0);
}

TEST(PureConvection, IsNoNearerToASphereThanGuidedConvection) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.05);
    for (const std::uint64_t seed : {1u, 2u, 3u}) {
        const Samples s(*sphere, 0.15, seed);
        const auto& points = s.particles.position;
        const auto largest_error = [&](const CellLabels& labels) {
            const auto mesh = mesh_of(carve(s.cells, labels, points), points);
            double largest = 0.0;
            for (const auto& e : triangle_errors(mesh.points, mesh.triangles, *sphere, 6))
                largest = std::max(largest, e.largest);
            return largest;
        };
        EXPECT_LE(largest_error(guided_convection(s.cells, points, s.particles.normal, *sphere)),
                  largest_error(pure_convection(s.cells, points)));
    }
}

TEST(PureConvection, LeavesVoidsFilled) {
    const auto surface = shapes::shell({0, 0, 0}, 1.0, 0.3, 0.05);
    const Samples s(*surface, 0.12);
    const auto carved = carve(s.cells, pure_convection(s.cells, s.particles.position), s.particles.position);
    expect_solid(mesh_of(carved, s.particles.position), 1, 2);
    // The particles of the inner sphere are on no boundary facet, those of the outer one are.
    for (const int p : carved.particle) EXPECT_GT(s.particles.position[p].norm(), 0.85);
    const auto outer = std::count_if(s.particles.position.begin(), s.particles.position.end(),
                                     [](const Vec3& p) { return p.norm() > 0.85; });
    EXPECT_EQ(static_cast<std::ptrdiff_t>(carved.particle.size()), outer);
}

TEST(UpdateLabels, GivesWhatLabellingEverythingGives) {
    const auto surface = shapes::torus({0, 0, 0}, 1.0, 0.4, 0.05);
    Samples s(*surface, 0.3);
    const auto dt = make_tetrahedralisation(UpdateStrategy::Auto);
    dt->assign(s.particles.position);
    CellLabels labels;
    update_labels(labels, dt->take_changed(), dt->cells(), s.particles.position, s.particles.normal,
                  *surface);
    const auto probe = surface->probe();
    for (int i = 0; i < 10; ++i) {
        const Vec3 p = *probe->project(s.particles.position[7 * i] + Vec3(0.05, 0.04, 0.03));
        s.particles.add(p, probe->normal(p), 0.3, 1000 + i);
        dt->insert(p, 7 * i);
    }
    dt->settle();
    const auto changed = dt->take_changed();
    EXPECT_LT(changed.size(), dt->cells().size() / 2);
    update_labels(labels, changed, dt->cells(), s.particles.position, s.particles.normal, *surface);
    EXPECT_EQ(labels, guided_convection(dt->cells(), s.particles.position, s.particles.normal, *surface));
}

}  // namespace
}  // namespace isotrack
