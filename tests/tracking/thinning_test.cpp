// Deaths: what is left of a mesh without them.
#include "tracking/thinning.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "isotrack/meshing/convection.h"
#include "isotrack/meshing/manifold.h"
#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/surface/shapes.h"
#include "support/particles.h"
#include "tracking/last_mesh.h"

namespace isotrack {
namespace {

constexpr double kError = 0.01, kDetail = 0.05;

shapes::SurfacePtr unit_sphere() {
    return shapes::sphere({0, 0, 0}, 1.0, 0.1);
}

struct Dense {
    Particles particles = support::settled_on_unit_sphere(3000, 0.2);  // where 0.07 is between them
    std::vector<Triangle> triangles;

    Dense() {
        const auto sphere = unit_sphere();
        const Tetrahedra cells = tetrahedralise(particles.position);
        const CellLabels labels = guided_convection(cells, particles.position, particles.normal, *sphere);
        triangles = particle_triangles(carve(cells, labels, particles.position));
    }
    TriangleMesh mesh() const {
        TriangleMesh result;
        result.points = particles.position;
        result.triangles = triangles;
        return result;
    }
};

/// By the ring of the triangles.
std::vector<char> thinned(const Particles& particles, std::vector<Triangle>& triangles,
                          const Surface& surface, const CrossingGrid& crossings,
                          const ThinningLimits& limits) {
    const Adjacency ring = ring_of(triangles, particles.size());
    return thin(particles, triangles, ring, surface, crossings, limits);
}

double least_angle(const Vec3& a, const Vec3& b, const Vec3& c) {
    const auto at = [](const Vec3& p, const Vec3& q, const Vec3& r) {
        return std::acos((q - p).normalized().dot((r - p).normalized())) * 180.0 / 3.14159265358979;
    };
    return std::min({at(a, b, c), at(b, c, a), at(c, a, b)});
}

TEST(Thinning, DoesNotMindNeighboursBeyondTheRing) {
    Dense one, other;
    const Adjacency ring = ring_of(one.triangles, one.particles.size());
    const auto sphere = unit_sphere();
    const CrossingGrid crossings(*sphere);
    const ThinningLimits limits{0.7, kError, kError, kDetail};
    const auto keep = thin(one.particles, one.triangles, ring, *sphere, crossings, limits);
    EXPECT_NE(std::count(keep.begin(), keep.end(), 0), 0);
    EXPECT_EQ(thin(other.particles, other.triangles, ring.squared(), *sphere, crossings, limits), keep);
    EXPECT_EQ(other.triangles, one.triangles);
}

TEST(Thinning, LeavesAClosedMeshWithinTheErrorWithoutSharpTriangles) {
    Dense dense;
    const MeshTopology before = mesh_topology(dense.mesh());
    ASSERT_TRUE(before.closed());
    double sharpest = 30.0;
    for (const auto& [a, b, c] : dense.triangles)
        sharpest = std::min(sharpest, least_angle(dense.particles.position[a], dense.particles.position[b],
                                                  dense.particles.position[c]));
    const auto sphere = unit_sphere();
    const auto keep = thinned(dense.particles, dense.triangles, *sphere, CrossingGrid(*sphere),
                              {0.7, kError, kError, kDetail});
    ASSERT_EQ(keep.size(), dense.particles.size());
    const auto kept = static_cast<std::size_t>(std::count(keep.begin(), keep.end(), 1));
    EXPECT_LT(kept, 2000u);
    const MeshTopology after = mesh_topology(dense.mesh());
    EXPECT_TRUE(after.closed());
    EXPECT_TRUE(after.oriented());
    EXPECT_TRUE(after.manifold());
    EXPECT_EQ(after.euler, 2);
    EXPECT_EQ(dense.triangles.size(), 2 * kept - 4);
    for (const Triangle& t : dense.triangles) {
        for (const int v : t) ASSERT_TRUE(keep[v]);
        const Vec3 &a = dense.particles.position[t[0]], &b = dense.particles.position[t[1]],
                   &c = dense.particles.position[t[2]];
        EXPECT_GT(((a + b + c) / 3.0).norm(), 1.0 - 1.001 * kError);
        EXPECT_GT((0.5 * (a + b)).norm(), 1.0 - 1.001 * kError);
        EXPECT_GE(least_angle(a, b, c), sharpest - 1e-9);
    }
}

TEST(Thinning, TakesNobodyWhoIsNotCrowded) {
    Dense dense;
    std::fill(dense.particles.spacing.begin(), dense.particles.spacing.end(), 0.04);
    const auto triangles = dense.triangles;
    const auto keep = thinned(dense.particles, dense.triangles, *unit_sphere(), CrossingGrid(*unit_sphere()),
                              {0.7, kError, kError, kDetail});
    EXPECT_EQ(std::count(keep.begin(), keep.end(), 0), 0);
    EXPECT_EQ(dense.triangles, triangles);
}

TEST(Thinning, KeepsWhoeverTheErrorNeeds) {
    Dense dense;
    const auto count_at = [&](double error) {
        std::vector<Triangle> triangles = dense.triangles;
        const auto keep = thinned(dense.particles, triangles, *unit_sphere(), CrossingGrid(*unit_sphere()),
                                  {1.0, error, error, kDetail});
        return std::count(keep.begin(), keep.end(), 1);
    };
    EXPECT_EQ(count_at(1e-5), 3000);
    EXPECT_LT(count_at(0.004), 2900);
    EXPECT_LT(count_at(0.008), count_at(0.004));
}

TEST(Thinning, KeepsTheCornersAndEdgesOfABox) {
    // A grid of particles on each face of a cube, which share those on edges.
    constexpr int kSteps = 8;
    Particles particles;
    std::vector<Triangle> triangles;
    const auto number = [&](const Vec3& p) {
        for (std::size_t i = 0; i < particles.size(); ++i)
            if ((particles.position[i] - p).norm() < 1e-9) return static_cast<int>(i);
        particles.add(p, p.normalized(), 1.0, static_cast<Id>(particles.size()));
        return static_cast<int>(particles.size()) - 1;
    };
    for (int axis = 0; axis < 3; ++axis)
        for (const double side : {-1.0, 1.0})
            for (int i = 0; i < kSteps; ++i)
                for (int j = 0; j < kSteps; ++j) {
                    const auto at = [&](int u, int v) {
                        Vec3 p;
                        p[axis] = side;
                        p[(axis + 1) % 3] = 2.0 * u / kSteps - 1.0;
                        p[(axis + 2) % 3] = 2.0 * v / kSteps - 1.0;
                        return number(p);
                    };
                    const int a = at(i, j), b = at(i + 1, j), c = at(i + 1, j + 1), d = at(i, j + 1);
                    if (side > 0.0)
                        triangles.insert(triangles.end(), {{a, b, c}, {a, c, d}});
                    else
                        triangles.insert(triangles.end(), {{a, c, b}, {a, d, c}});
                }
    const auto box = shapes::box({0, 0, 0}, {1, 1, 1}, 0.1);
    const auto keep = thinned(particles, triangles, *box, CrossingGrid(*box), {0.7, 0.02, 0.02, 0.1});
    EXPECT_LT(std::count(keep.begin(), keep.end(), 1), static_cast<long>(3 * particles.size() / 4));
    for (std::size_t i = 0; i < particles.size(); ++i)
        if (particles.position[i].cwiseAbs().minCoeff() > 0.999) {
            EXPECT_TRUE(keep[i]) << particles.position[i].transpose();
        }
    TriangleMesh mesh;
    mesh.points = particles.position;
    mesh.triangles = triangles;
    EXPECT_TRUE(mesh_topology(mesh).closed());
    EXPECT_EQ(mesh_topology(mesh).euler, 2);
    double volume = 0.0;
    for (const auto& [a, b, c] : triangles)
        volume += particles.position[a].dot(particles.position[b].cross(particles.position[c])) / 6.0;
    EXPECT_NEAR(volume, 8.0, 0.05);
}

TEST(Thinning, LeavesTheRimOfAnOpenMeshAndTheSmallestBodies) {
    Dense dense;
    std::vector<char> at_rim(dense.particles.size(), 0);
    std::vector<Triangle> open;
    for (const Triangle& t : dense.triangles) {
        const bool gone = dense.particles.position[t[0]].z() > 0.8;
        if (!gone) open.push_back(t);
        for (const int v : t) at_rim[v] = at_rim[v] || gone;
    }
    const auto keep = thinned(dense.particles, open, *unit_sphere(), CrossingGrid(*unit_sphere()),
                              {0.7, kError, kError, kDetail});
    EXPECT_LT(std::count(keep.begin(), keep.end(), 1), 2500);
    for (std::size_t i = 0; i < keep.size(); ++i) EXPECT_TRUE(keep[i] || !at_rim[i]);

    // A flat tetrahedron, all of whose corners face the same way, more or less.
    Particles corners;
    for (const Vec3& p : {Vec3(0, 0, 0.01), Vec3(1, 0, 0), Vec3(-0.5, 0.8, 0), Vec3(-0.5, -0.8, 0)})
        corners.add(0.05 * p, Vec3(0.1 * p.x(), 0.1 * p.y(), 1.0).normalized(), 1.0,
                    static_cast<Id>(corners.size()));
    std::vector<Triangle> tetrahedron{{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}};
    const auto plate = shapes::plate({0, 0, -0.1}, 1.0, 0.2, 0.1);
    const auto all = thinned(corners, tetrahedron, *plate, CrossingGrid(*plate), {1.0, 1.0, 1.0, 0.1});
    EXPECT_EQ(std::count(all.begin(), all.end(), 1), 4);
}

}  // namespace
}  // namespace isotrack
