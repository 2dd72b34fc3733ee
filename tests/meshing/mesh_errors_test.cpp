// How far meshes are from surfaces, both ways.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "isotrack/meshing/certify.h"
#include "isotrack/surface/shapes.h"
#include "support/distance.h"
#include "support/meshes.h"

namespace isotrack {
namespace {

TEST(TriangleErrors, AreThoseOfTheSampledPoints) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    const TriangleMesh mesh = support::icosphere(1, Vec3::Zero(), 1.05);
    for (const int steps : {1, 3, 6}) {
        const auto errors = triangle_errors(mesh.points, mesh.triangles, *sphere, steps);
        ASSERT_EQ(errors.size(), mesh.triangles.size());
        for (std::size_t t = 0; t < errors.size(); ++t) {
            const auto& [a, b, c] = mesh.triangles[t];
            double largest = 0.0, sum = 0.0;
            int count = 0;
            for (int i = 0; i <= steps; ++i)
                for (int j = 0; j <= steps - i; ++j, ++count) {
                    const Vec3 p =
                        (i * mesh.points[a] + j * mesh.points[b] + (steps - i - j) * mesh.points[c]) / steps;
                    const double e = std::abs(p.norm() - 1.0);
                    largest = std::max(largest, e);
                    sum += e * e;
                }
            EXPECT_NEAR(errors[t].largest, largest, 1e-12);
            EXPECT_NEAR(errors[t].mean_square, sum / count, 1e-12);
            EXPECT_NEAR(std::abs(errors[t].where.norm() - 1.0), largest, 1e-12);
        }
    }
}

TEST(TriangleErrors, FollowTheErrorBetweenThePointsWhenItMatters) {
    const auto torus = shapes::torus({0, 0, 0}, 1.0, 0.4, 0.1);
    const TriangleMesh mesh = support::torus(14, 9);
    const auto coarse = triangle_errors(mesh.points, mesh.triangles, *torus, 6);
    const auto fine = triangle_errors(mesh.points, mesh.triangles, *torus, 60);
    const auto found = triangle_errors(mesh.points, mesh.triangles, *torus, 6, 0.0);
    const auto unmoved = triangle_errors(mesh.points, mesh.triangles, *torus, 6, 1.0);
    const auto probe = torus->probe();
    for (std::size_t t = 0; t < fine.size(); ++t) {
        EXPECT_GE(found[t].largest, coarse[t].largest);
        EXPECT_NEAR(found[t].largest, fine[t].largest, 0.01 * fine[t].largest);
        EXPECT_EQ(found[t].mean_square, coarse[t].mean_square);
        EXPECT_EQ(unmoved[t].largest, coarse[t].largest);
        EXPECT_NEAR(std::abs(probe->value(found[t].where)), found[t].largest, 1e-12);
    }
}

TEST(TriangleErrors, FollowTheErrorOnBothSidesOfTheSurface) {
    // Corners on either side, so that the farthest sample is often not where the error is largest.
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    const auto probe = sphere->probe();
    std::mt19937 random(1);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    for (int trial = 0; trial < 2000; ++trial) {
        const Vec3 middle = Vec3(unit(random), unit(random), unit(random)).normalized();
        Vec3 corner[3];
        for (Vec3& c : corner) {
            c = (middle + 0.15 * Vec3(unit(random), unit(random), unit(random))).normalized();
            c *= 1.0 + 0.01 * unit(random);
        }
        const auto& [a, b, c] = corner;
        const int steps = error_steps(a, b, c, sphere->resolution());
        const double found = triangle_error(a, b, c, *probe, steps, 0.0).largest,
                     truth = triangle_error(a, b, c, *probe, 60).largest;
        EXPECT_NEAR(found, truth, 0.02 * truth);
    }
}

TEST(CrossingDistances, AreExactUpToTheCutoffAndInfiniteBeyond) {
    // A mesh of the left sphere alone: the crossings of the right one are far away.
    const auto surface =
        shapes::unite({shapes::sphere({-1, 0, 0}, 0.5, 0.1), shapes::sphere({1, 0.2, 0}, 0.6, 0.1)});
    const TriangleMesh mesh = support::icosphere(1, {-1, 0, 0}, 0.5);
    const CrossingGrid grid(*surface);
    ASSERT_GT(grid.size(), 500u);
    for (const double cutoff : {0.005, 0.05, 0.9}) {
        const auto distances = crossing_distances(mesh.points, mesh.triangles, grid, cutoff);
        ASSERT_EQ(distances.size(), grid.size());
        std::size_t finite = 0;
        for (std::size_t i = 0; i < grid.size(); ++i) {
            double least = std::numeric_limits<double>::infinity();
            bool doubtful = false;  // rounding decides whether the triangle counts
            for (const auto& [a, b, c] : mesh.triangles) {
                const Vec3 n =
                    (mesh.points[b] - mesh.points[a]).cross(mesh.points[c] - mesh.points[a]).normalized();
                const double facing = n.dot(grid[i].outward.cast<double>());
                const double d = support::distance_to_triangle(grid[i].point, mesh.points[a], mesh.points[b],
                                                               mesh.points[c]);
                if (std::abs(facing + 0.2) < 1e-6) doubtful = true;
                if (facing >= -0.2) least = std::min(least, d);
            }
            if (doubtful || std::abs(least - cutoff) < 1e-9) continue;
            if (least > cutoff) {
                ASSERT_TRUE(std::isinf(distances[i])) << least;
                continue;
            }
            ASSERT_NEAR(distances[i], least, 0x1p-24 * least + 1e-9);  // a float
            ++finite;
        }
        EXPECT_GT(finite, 0u);
        EXPECT_LT(finite, grid.size());

        std::vector<int> some;
        std::vector<float> of_some(grid.size(), -1.0f), expected = of_some;
        for (std::size_t i = 0; i < grid.size(); i += 7) {
            some.push_back(static_cast<int>(i));
            expected[i] = distances[i];
        }
        crossing_distances(mesh.points, mesh.triangles, grid, some, cutoff, of_some);
        EXPECT_EQ(of_some, expected);
    }
}

TEST(FacingTriangle, IsAsFarAsItsNearestPointUpToALimit) {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    const auto place = [&] { return Vec3(unit(random), unit(random), unit(random)); };
    int within = 0, beyond = 0;
    for (int trial = 0; trial < 30000; ++trial) {
        const Vec3 a = place();
        Vec3 b = place(), c = place();
        if (trial % 3 == 1) c = a + unit(random) * (b - a) + 1e-4 * place();  // nearly without area
        if (trial % 3 == 2) b = a + 1e-4 * place();
        const Surface::Crossing crossing{place(), (b - a).cross(c - a).normalized().cast<float>()};
        const double truth = support::distance_to_triangle(crossing.point, a, b, c),
                     limit = std::abs(unit(random)),
                     found = std::sqrt(FacingTriangle(a, b, c).squared_distance(crossing, limit * limit));
        if (truth < limit || std::isfinite(found)) {
            EXPECT_NEAR(found, truth, 1e-9) << trial;
        }
        ++(truth < limit ? within : beyond);
    }
    EXPECT_GT(within, 5000);
    EXPECT_GT(beyond, 5000);
    const FacingTriangle without_area({0, 0, 0}, {1, 0, 0}, {0, 0, 0});
    EXPECT_NEAR(without_area.squared_distance({{0.5, 2.0, 0.0}, {0.0f, 1.0f, 0.0f}}, 5.0), 4.0, 1e-12);
    EXPECT_NEAR(without_area.squared_distance({{3.0, 0.0, 0.0}, {0.0f, 1.0f, 0.0f}}, 5.0), 4.0, 1e-12);
}

TEST(CrossingDistances, AreInfiniteWithoutAMesh) {
    const CrossingGrid grid(*shapes::sphere({0, 0, 0}, 1.0, 0.2));
    for (const double d : crossing_distances({}, {}, grid, 1.0)) EXPECT_TRUE(std::isinf(d));
    EXPECT_TRUE(crossing_distances({}, {}, CrossingGrid(std::vector<Surface::Crossing>(), 1.0), 1.0).empty());
}

}  // namespace
}  // namespace isotrack
