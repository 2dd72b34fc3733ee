// The error of triangles where it is known.
#include "isotrack/meshing/certify.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <utility>

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
        return certified_errors(points, {{0, 1, 2}}, *bumps(height), bumps(height)->resolution(),
                                refine_above)[0];
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

/// Counts what it is asked.
class CountingProbe final : public Surface::Probe {
public:
    explicit CountingProbe(std::function<double(const Vec3&)> value)
        : Probe(1e-4, 1.0), value_(std::move(value)) {}
    double value(const Vec3& p) override {
        ++count;
        return value_(p);
    }
    Surface::Sample sample(const Vec3& p) override { return {value(p), Vec3::Zero()}; }
    int count = 0;

private:
    std::function<double(const Vec3&)> value_;
};

TEST(TriangleError, IsFoundBetweenThePointsOfASmoothOneByOneMore) {
    // Over a saddle, largest inside an edge.
    const Vec3 a(0, 0, 0), b(3, 0, 0), c(0, 3, 0);
    CountingProbe smooth(
        [](const Vec3& p) { return 0.1 * (p.x() * (3.0 - p.x()) + 0.3 * p.y() * p.y() - p.y()); });
    constexpr int kPoints = 10;
    EXPECT_NEAR(triangle_error(a, b, c, smooth, 3, 0.18).largest, 0.1 * 1.5 * 1.5, 1e-9);
    EXPECT_EQ(smooth.count, kPoints + 1);
    // Where it comes to much it is followed.
    smooth.count = 0;
    EXPECT_NEAR(triangle_error(a, b, c, smooth, 3, 0.1).largest, 0.1 * 1.5 * 1.5, 2e-3);
    EXPECT_GT(smooth.count, kPoints + 1);
}

TEST(TriangleError, IsLookedAtNoCloserWhereItIsTooMuch) {
    const Vec3 a(0, 0, 0), b(3, 0, 0), c(0, 3, 0);
    constexpr double kDetail = 2.0;
    constexpr int kPoints = 10;
    ASSERT_EQ(error_steps(a, b, c, kDetail), 3);
    // 0.13 at the points, 0.15 between them.
    CountingProbe kink([](const Vec3& p) { return 0.1 * (1.5 - std::abs(p.x() - 1.3)) - 0.02 * p.y(); });
    const auto found_up_to = [&](double too_much) {
        kink.count = 0;
        return certified_error(a, b, c, kink, kDetail, 0.11, too_much).largest;
    };
    const double in_full = certified_error(a, b, c, kink, kDetail, 0.11).largest;
    EXPECT_NEAR(in_full, 0.15, 4e-3);
    EXPECT_NEAR(found_up_to(0.115), 0.12, 1e-9);
    EXPECT_EQ(kink.count, kPoints);
    EXPECT_GT(found_up_to(0.14), 0.14);  // found between them
    EXPECT_GT(kink.count, kPoints);
    EXPECT_EQ(found_up_to(0.16), in_full);
}

TEST(TriangleError, IsFollowedWhereThePointsAreNoneOfASmoothOne) {
    const Vec3 a(0, 0, 0), b(3, 0, 0), c(0, 3, 0);
    constexpr int kPoints = 10;
    CountingProbe kink([](const Vec3& p) { return 0.1 * (1.5 - std::abs(p.x() - 1.3)) - 0.02 * p.y(); });
    EXPECT_NEAR(triangle_error(a, b, c, kink, 3, 0.11).largest, 0.15, 4e-3);
    EXPECT_GT(kink.count, kPoints + 1);
    // With the kink half way between points they are those of a smooth one, but not its peak.
    CountingProbe cut(
        [](const Vec3& p) { return std::min(0.1 * (1.5 - std::abs(p.x() - 1.5)), 0.13) - 0.02 * p.y(); });
    EXPECT_NEAR(triangle_error(a, b, c, cut, 3, 0.095).largest, 0.13, 4e-3);
    EXPECT_GT(cut.count, kPoints + 1);
}

/// A triangle in the plane z = 0, about its middle, turned about the x axis.
std::array<Vec3, 3> turned(double degrees, double size) {
    const double turn = degrees * 3.14159265358979323846 / 180.0, along = std::cos(turn), up = std::sin(turn);
    const auto at = [&](double x, double y) -> Vec3 { return size * Vec3(x, along * y, up * y); };
    return {at(-0.5, -0.3), at(0.5, -0.3), at(0.0, 0.6)};
}

double deviation(const std::array<Vec3, 3>& t, const std::function<double(const Vec3&)>& value) {
    const auto surface = shapes::from_function(value, Box(Vec3(-9, -9, -9), Vec3(9, 9, 9)), 1.0);
    return turned_deg(t[0], t[1], t[2], *surface->probe(), surface->resolution());
}

TEST(TurnedTriangle, IsTheAngleToAPlane) {
    for (const double degrees : {0.0, 20.0, 59.0, 75.0, 120.0, 180.0})
        EXPECT_NEAR(deviation(turned(degrees, 3.0), [](const Vec3& p) { return p.z(); }), degrees, 0.01);
}

TEST(TurnedTriangle, IsThatToEitherSideOfACrease) {
    const auto roof = [](const Vec3& p) { return std::max(p.x(), p.z()); };
    // On the side that looks along x, with a tip beyond the crease that takes the centroid across.
    const std::array<Vec3, 3> tip = {Vec3(-0.2, 0, -0.3), Vec3(-0.2, 1.5, -0.3), Vec3(-0.2, 0.7, 0.7)};
    const Vec3 normal = (tip[1] - tip[0]).cross(tip[2] - tip[0]).normalized();
    ASSERT_NEAR(normal.x(), 1.0, 1e-12);
    ASSERT_GT(((tip[0] + tip[1] + tip[2]) / 3.0).z(), -0.2);
    EXPECT_NEAR(deviation(tip, roof), 0.0, 0.01);
    // Neither side looks the other way.
    EXPECT_NEAR(deviation({tip[0], tip[2], tip[1]}, roof), 90.0, 0.01);
}

TEST(TurnedTriangle, IsThatToTheCornerThatFacesBestWhicheverComesFirst) {
    // Normals point away from the y axis: by these angles from the triangle's at its corners, 68 degrees at
    // the centroid.
    const auto at = [](double degrees, double y) {
        return Vec3(std::tan(degrees * 3.14159265358979323846 / 180.0), y, 1.0);
    };
    const auto off_axis = [](const Vec3& p) { return std::hypot(p.x(), p.z()) - 1.0; };
    const Vec3 a = at(57.0, 0.0), b = at(80.0, 0.0), c = at(8.0, 3.0);
    for (const auto& corners : {std::array<Vec3, 3>{a, b, c}, {b, c, a}, {c, a, b}})
        EXPECT_NEAR(deviation(corners, off_axis), 8.0, 0.01);
}

TEST(TurnedTriangle, SaysNothingOfWhatIsSmallOrHasNoNormal) {
    const auto plane = [](const Vec3& p) { return p.z(); };
    EXPECT_GT(deviation(turned(120.0, 0.6), plane), 0.0);  // 0.54 high
    EXPECT_EQ(deviation(turned(120.0, 0.5), plane), 0.0);
    EXPECT_GT(deviation(turned(120.0, 3.0), [](const Vec3& p) { return 0.7 * p.z(); }), 0.0);
    EXPECT_EQ(deviation(turned(120.0, 3.0), [](const Vec3& p) { return 0.5 * p.z(); }), 0.0);
}

}  // namespace
}  // namespace isotrack
