// The error of triangles where it is known.
#include "isotrack/meshing/certify.h"

#include <gtest/gtest.h>

#include <cmath>

#include "isotrack/surface/shapes.h"

namespace isotrack {
namespace {

/// A bump in the middle of the triangle's points with three intervals per edge, and a higher one between
/// them.
class TwoBumps : public ::testing::Test {
protected:
    const std::vector<Vec3> points = {{0, 0, 0}, {2, 0, 0}, {0, 2, 0}};
    const Vec3 narrow = Vec3(1.0 / 3, 1.0 / 3, 0);

    static shapes::SurfacePtr bumps(double height) {
        const auto bump = [](const Vec3& p, const Vec3& at, double width) {
            return std::exp(-(p - at).squaredNorm() / (width * width));
        };
        return shapes::from_function(
            [=](const Vec3& p) {
                return height * std::max(0.8 * bump(p, Vec3(2.0 / 3, 2.0 / 3, 0), 0.3),
                                         0.9 * bump(p, Vec3(1.0 / 3, 1.0 / 3, 0), 0.1));
            },
            Box(Vec3(-1, -1, -1), Vec3(3, 3, 1)), 1.0);
    }
    TriangleError found(double height, double refine_above) const {
        return triangle_errors(points, {{0, 1, 2}}, *bumps(height), kStepsByLength, refine_above)[0];
    }
};

TEST_F(TwoBumps, AreNotToldApartByAFewPoints) {
    ASSERT_EQ(error_steps(points[0], points[1], points[2], 1.0), 3);
    EXPECT_NEAR(triangle_error(points[0], points[1], points[2], *bumps(1.0)->probe(), 3, 0.5).largest, 0.8,
                1e-3);
}

TEST_F(TwoBumps, AreToldApartWhereTheErrorIsLarge) {
    EXPECT_NEAR(found(0.2, 0.1).largest, 0.18, 1e-3);
    EXPECT_LT((found(0.2, 0.1).where - narrow).norm(), 0.05);
    // Far below what matters three intervals are enough.
    EXPECT_NEAR(found(0.2, 0.14).largest, 0.16, 1e-3);
}

TEST_F(TwoBumps, AreToldApartWhereValuesChangeSteeply) {
    EXPECT_NEAR(found(1.0, 0.7).largest, 0.9, 1e-3);
    EXPECT_LT((found(1.0, 0.7).where - narrow).norm(), 0.05);
}

}  // namespace
}  // namespace isotrack
