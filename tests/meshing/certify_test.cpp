// The error of triangles where it is known.
#include "isotrack/meshing/certify.h"

#include <gtest/gtest.h>

#include <cmath>

#include "isotrack/surface/shapes.h"

namespace isotrack {
namespace {

TEST(TriangleErrors, FindTheLargerOfTwoMaximaThatAFewPointsMiss) {
    const std::vector<Vec3> points = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}};
    const auto bump = [](const Vec3& p, const Vec3& at, double height, double width) {
        return height * std::exp(-(p - at).squaredNorm() / (width * width));
    };
    // The one is at a point of the lattice with three intervals per edge, the other between them.
    const Vec3 wide(2.0 / 3, 2.0 / 3, 0), narrow(1.0 / 3, 1.0 / 3, 0);
    const auto surface = shapes::from_function(
        [&](const Vec3& p) { return std::max(bump(p, wide, 0.8, 0.3), bump(p, narrow, 0.9, 0.1)); },
        Box(Vec3(-1, -1, -1), Vec3(3, 3, 1)), 1.0);
    ASSERT_EQ(error_steps(points[0], points[1], points[2], 1.0), 3);
    EXPECT_NEAR(triangle_error(points[0], points[1], points[2], *surface->probe(), 3, 0.5).largest, 0.8,
                1e-3);
    const auto by_length = triangle_errors(points, {{0, 1, 2}}, *surface, kStepsByLength, 0.5);
    EXPECT_NEAR(by_length[0].largest, 0.9, 1e-3);
    EXPECT_LT((by_length[0].where - narrow).norm(), 0.05);
    // Far below what matters three intervals are enough.
    EXPECT_NEAR(triangle_errors(points, {{0, 1, 2}}, *surface, kStepsByLength, 0.7)[0].largest, 0.8, 1e-3);
}

}  // namespace
}  // namespace isotrack
