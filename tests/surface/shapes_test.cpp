#include "isotrack/surface/shapes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "isotrack/error.h"
#include "isotrack/surface/level_set.h"
#include "isotrack/surface/rasterise.h"

namespace isotrack {
namespace {

constexpr double kPi = 3.14159265358979323846;
const Vec3 kCentre(0.3, -0.2, 0.5);

struct Case {
    std::string name;
    shapes::SurfacePtr surface;
    std::vector<Vec3>
        points;  // on the surface, from a parametrisation; no surface point is farther than `gap` from one
    double gap;
};

std::vector<Vec3> on_ellipsoid(const Vec3& axes, int n) {
    std::vector<Vec3> points;
    for (int i = 0; i <= n; ++i)
        for (int j = 0; j < 2 * n; ++j) {
            const double u = kPi * i / n, v = kPi * j / n;
            points.push_back(kCentre + axes.cwiseProduct(Vec3(std::sin(u) * std::cos(v),
                                                              std::sin(u) * std::sin(v), std::cos(u))));
        }
    return points;
}

std::vector<Vec3> on_torus(double major, double minor, int n) {
    std::vector<Vec3> points;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
            const double u = 2.0 * kPi * i / n, v = 2.0 * kPi * j / n, r = major + minor * std::cos(v);
            points.push_back(kCentre + Vec3(r * std::cos(u), r * std::sin(u), minor * std::sin(v)));
        }
    return points;
}

std::vector<Vec3> on_box(const Vec3& half, int n) {
    std::vector<Vec3> points;
    for (int axis = 0; axis < 3; ++axis)
        for (const double side : {-1.0, 1.0})
            for (int i = 0; i <= n; ++i)
                for (int j = 0; j <= n; ++j) {
                    Vec3 p;
                    p[axis] = side * half[axis];
                    p[(axis + 1) % 3] = half[(axis + 1) % 3] * (2.0 * i / n - 1.0);
                    p[(axis + 2) % 3] = half[(axis + 2) % 3] * (2.0 * j / n - 1.0);
                    points.push_back(kCentre + p);
                }
    return points;
}

std::vector<Vec3> on_plate(double radius, double thickness, int n) {
    const double half = 0.5 * thickness, disk = radius - half;
    std::vector<Vec3> points;
    for (int j = 0; j < 2 * n; ++j) {
        const Vec3 out(std::cos(kPi * j / n), std::sin(kPi * j / n), 0.0);
        for (int i = 0; i <= n; ++i) {
            for (const double side : {-1.0, 1.0})
                points.push_back(kCentre + Vec3(0, 0, side * half) + out * (disk * i / n));
            const double u = kPi * i / n - 0.5 * kPi;
            points.push_back(kCentre + disk * out + half * (std::cos(u) * out + std::sin(u) * Vec3::UnitZ()));
        }
    }
    return points;
}

std::vector<Vec3> on_two_spheres(double outer, double inner, int n) {
    std::vector<Vec3> points = on_ellipsoid(Vec3::Constant(outer), n);
    for (const Vec3& p : on_ellipsoid(Vec3::Constant(inner), n)) points.push_back(p);
    return points;
}

std::vector<Case> cases() {
    const Vec3 axes(0.5, 0.3, 0.1);
    std::vector<Case> all{
        {"sphere", shapes::sphere(kCentre, 0.4, 0.05), on_ellipsoid(Vec3::Constant(0.4), 60), 0.02},
        {"ellipsoid", shapes::ellipsoid(kCentre, axes, 0.05), on_ellipsoid(axes, 80), 0.02},
        {"oblate", shapes::ellipsoid(kCentre, {0.4, 0.4, 0.1}, 0.05), on_ellipsoid({0.4, 0.4, 0.1}, 80),
         0.02},
        {"torus", shapes::torus(kCentre, 0.4, 0.15, 0.05), on_torus(0.4, 0.15, 150), 0.02},
        {"box", shapes::box(kCentre, axes, 0.05), on_box(axes, 60), 0.02},
        {"plate", shapes::plate(kCentre, 0.4, 0.12, 0.05), on_plate(0.4, 0.12, 60), 0.02},
        {"shell", shapes::shell(kCentre, 0.4, 0.1, 0.05), on_two_spheres(0.4, 0.3, 60), 0.02},
    };
    const Eigen::Isometry3d motion =
        Eigen::Translation3d(0.2, 0.1, -0.3) * Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized());
    Case turned = all[4];
    turned.name = "turned box";
    turned.surface = shapes::moved(turned.surface, motion);
    for (Vec3& p : turned.points) p = motion * p;
    all.push_back(turned);
    return all;
}

std::vector<Vec3> queries_around(const Surface& surface, int count, std::uint64_t seed) {
    const Box box = surface.bounds();
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> unit(-0.3, 1.3);
    std::vector<Vec3> queries;
    for (int i = 0; i < count; ++i) {
        const Vec3 t(unit(random), unit(random), unit(random));
        queries.push_back(box.min() + t.cwiseProduct(box.sizes()));
    }
    return queries;
}

TEST(Shapes, DistancesAgreeWithBruteForceOverSurfacePoints) {
    for (const Case& shape : cases()) {
        const auto probe = shape.surface->probe();
        for (const Vec3& p : shape.points) ASSERT_NEAR(probe->value(p), 0.0, 1e-12) << shape.name;
        for (const Vec3& q : queries_around(*shape.surface, 300, 7)) {
            double nearest = std::numeric_limits<double>::infinity();
            for (const Vec3& p : shape.points) nearest = std::min(nearest, (p - q).norm());
            const double distance = std::abs(probe->value(q));
            EXPECT_LE(distance, nearest + 1e-12) << shape.name << " at " << q.transpose();
            EXPECT_GE(std::hypot(distance, shape.gap) + 0.5 * shape.gap, nearest)
                << shape.name << " at " << q.transpose();
        }
    }
}

std::vector<Case> with_composites() {
    std::vector<Case> all = cases();
    for (const double gap : {0.3, 0.5, 0.6, 0.66, 0.71, 0.9})
        all.push_back(
            {"pair at " + std::to_string(gap),
             shapes::blended_spheres(kCentre, 0.3, kCentre + gap * Vec3(2, 1, -2) / 3.0, 0.2, 0.1, 0.05),
             {},
             0});
    all.push_back({"union",
                   shapes::unite({all[0].surface, shapes::sphere({1.5, 0, 0.5}, 0.2, 0.1), all[7].surface}),
                   {},
                   0});
    return all;
}

TEST(Shapes, GradientsAreDerivativesOfTheValue) {
    constexpr double kStep = 1e-6;
    for (const Case& shape : with_composites()) {
        const auto probe = shape.surface->probe();
        int compared = 0;
        for (const Vec3& q : queries_around(*shape.surface, 500, 11)) {
            Vec3 numeric;
            for (int i = 0; i < 3; ++i)
                numeric[i] =
                    (probe->value(q + kStep * Vec3::Unit(i)) - probe->value(q - kStep * Vec3::Unit(i))) /
                    (2 * kStep);
            if (std::abs(numeric.norm() - 1.0) > 1e-4) continue;  // on the medial axis
            const Surface::Sample at = probe->sample(q);
            EXPECT_EQ(at.value, probe->value(q));
            EXPECT_LT((at.gradient - numeric).norm(), 1e-4) << shape.name << " at " << q.transpose();
            ++compared;
        }
        EXPECT_GT(compared, 490) << shape.name;
    }
}

TEST(Shapes, ProjectionIsTheClosestPoint) {
    for (const Case& shape : with_composites()) {
        if (shape.name == "union") continue;  // only a lower bound inside
        const auto probe = shape.surface->probe();
        for (const Vec3& q : queries_around(*shape.surface, 500, 13)) {
            const auto p = probe->project(q);
            ASSERT_TRUE(p);
            EXPECT_NEAR(probe->value(*p), 0.0, 1e-12) << shape.name << " at " << q.transpose();
            EXPECT_NEAR((*p - q).norm(), std::abs(probe->value(q)), 1e-12)
                << shape.name << " at " << q.transpose();
        }
    }
}

TEST(Shapes, BoundsHoldTheInside) {
    for (const Case& shape : with_composites()) {
        const auto probe = shape.surface->probe();
        const Box box = shape.surface->bounds();
        int inside = 0;
        for (const Vec3& q : queries_around(*shape.surface, 3000, 17)) {
            if (probe->value(q) >= 0.0) continue;
            ++inside;
            EXPECT_TRUE(box.contains(q)) << shape.name;
        }
        EXPECT_GT(inside, 10) << shape.name;
    }
}

TEST(Shapes, SignIsNegativeInside) {
    EXPECT_DOUBLE_EQ(shapes::sphere(kCentre, 0.4, 0.1)->probe()->value(kCentre), -0.4);
    EXPECT_DOUBLE_EQ(shapes::ellipsoid(kCentre, {0.4, 0.3, 0.2}, 0.1)->probe()->value(kCentre), -0.2);
    EXPECT_DOUBLE_EQ(shapes::box(kCentre, {0.4, 0.3, 0.2}, 0.1)->probe()->value(kCentre), -0.2);
    EXPECT_DOUBLE_EQ(shapes::plate(kCentre, 0.4, 0.2, 0.1)->probe()->value(kCentre), -0.1);
    EXPECT_DOUBLE_EQ(shapes::torus(kCentre, 0.4, 0.1, 0.1)->probe()->value(kCentre), 0.3);
    EXPECT_DOUBLE_EQ(shapes::torus(Vec3::Zero(), 0.4, 0.1, 0.1)->probe()->value({0.4, 0, 0}), -0.1);
    EXPECT_DOUBLE_EQ(shapes::shell(Vec3::Zero(), 0.4, 0.1, 0.1)->probe()->value(Vec3::Zero()), 0.3);
    EXPECT_NEAR(shapes::shell(Vec3::Zero(), 0.4, 0.1, 0.1)->probe()->value({0, 0.35, 0}), -0.05, 1e-15);
}

TEST(Shapes, EllipsoidIsExactOnItsAxesAndPlanesOfSymmetry) {
    const Vec3 e(0.5, 0.3, 0.1);
    const auto surface = shapes::ellipsoid(Vec3::Zero(), e, 0.01);
    const auto probe = surface->probe();
    const auto points = on_ellipsoid(e, 400);
    for (const Vec3& q : {Vec3(0.1, 0, 0), Vec3(0.45, 0, 0), Vec3(0.499, 0, 0), Vec3(0, 0.2, 0),
                          Vec3(0, 0.29, 0), Vec3(0, 0, 0.05), Vec3(0.3, 0.1, 0), Vec3(0.3, 0.1, 1e-300),
                          Vec3(1e-300, 0.1, 0.01), Vec3(2, 0, 0), Vec3(0, 2, 1e-9)}) {
        double nearest = std::numeric_limits<double>::infinity();
        for (const Vec3& p : points) nearest = std::min(nearest, (p - kCentre - q).norm());
        EXPECT_NEAR(std::abs(probe->value(q)), nearest, 1e-4) << q.transpose();
    }
}

// The promise, by brute force: outside is what a ball of radius `fillet` sweeps that stays clear of both
// spheres.
TEST(Shapes, BlendedSpheresAreOutsideWhereTheFilletBallReaches) {
    constexpr double kA = 0.3, kB = 0.2, kFillet = 0.1, kMargin = 0.004;
    for (const double gap : {0.35, 0.5, 0.62, 0.66, 0.69}) {
        const auto surface = shapes::blended_spheres(Vec3::Zero(), kA, {gap, 0, 0}, kB, kFillet, 0.05);
        const auto probe = surface->probe();
        std::vector<Eigen::Vector2d> centres;
        for (double x = -0.6; x < gap + 0.6; x += 0.002)
            for (double r = -0.2; r < 0.6; r += 0.002)
                if (std::hypot(x, r) >= kA + kFillet && std::hypot(x - gap, r) >= kB + kFillet)
                    centres.push_back({x, r});
        std::mt19937_64 random(3);
        std::uniform_real_distribution<double> x(-0.1, gap + 0.1), r(0.0, 0.15);
        for (int i = 0; i < 150; ++i) {
            const Eigen::Vector2d q(x(random), r(random));
            const double value = probe->value({q.x(), 0.6 * q.y(), 0.8 * q.y()});
            if (std::abs(value) < kMargin) continue;
            double nearest = std::numeric_limits<double>::infinity();
            for (const auto& c : centres) nearest = std::min(nearest, (c - q).norm());
            EXPECT_EQ(value > 0.0, nearest < kFillet)
                << "gap " << gap << " at " << q.transpose() << ": " << value;
        }
    }
}

TEST(Shapes, BlendedSpheresPartWhenTheFilletReachesTheAxis) {
    const auto neck = [](double gap) {
        const auto surface = shapes::blended_spheres(Vec3::Zero(), 0.25, {gap, 0, 0}, 0.25, 0.1, 0.05);
        const auto probe = surface->probe();
        return probe->value({0.5 * gap, 0, 0});
    };
    const double parting = 2.0 * std::sqrt(0.35 * 0.35 - 0.1 * 0.1);
    EXPECT_LT(neck(parting - 0.01), 0.0);
    EXPECT_NEAR(neck(parting), 0.0, 1e-7);  // a root of a difference: half the digits
    EXPECT_GT(neck(parting + 0.01), 0.0);
}

TEST(Shapes, FunctionIsSampledWithItsGradient) {
    const auto surface =
        shapes::from_function([](const Vec3& p) { return p.x() * p.x() + 2.0 * p.y() - p.z(); },
                              Box(Vec3(-1, -1, -1), Vec3(1, 1, 1)), 0.1);
    const Surface::Sample at = surface->probe()->sample({0.5, 0.25, 0.125});
    EXPECT_DOUBLE_EQ(at.value, 0.625);
    EXPECT_LT((at.gradient - Vec3(1.0, 2.0, -1.0)).norm(), 1e-9);
    EXPECT_EQ(surface->resolution(), 0.1);
}

TEST(Shapes, UnionTakesTheNearestPartAndTheFinestResolution) {
    const auto both =
        shapes::unite({shapes::sphere({0, 0, 0}, 1.0, 0.1), shapes::sphere({3, 0, 0}, 0.5, 0.02)});
    EXPECT_EQ(both->resolution(), 0.02);
    const auto probe = both->probe();
    EXPECT_DOUBLE_EQ(probe->value({2.2, 0, 0}), 0.3);
    EXPECT_DOUBLE_EQ(probe->value({3, 0, 0}), -0.5);
    const auto p = probe->project({2.2, 0, 0});
    ASSERT_TRUE(p);
    EXPECT_LT((*p - Vec3(2.5, 0, 0)).norm(), 1e-12);
}

TEST(Shapes, UnionProjectsOnlyToItsOwnSurface) {
    const auto both =
        shapes::unite({shapes::sphere({0, 0, 0}, 1.0, 0.1), shapes::sphere({0.5, 0, 0}, 1.0, 0.1)});
    const auto probe = both->probe();
    for (const Vec3& q : queries_around(*both, 300, 19)) {
        const auto p = probe->project(q);
        if (!p) continue;
        EXPECT_NEAR(probe->value(*p), 0.0, 1e-6) << q.transpose();
    }
}

TEST(Shapes, PassOnWhatAGridKnowsBeyondItsBand) {
    const double h = 0.05;
    const auto ball = std::make_shared<const LevelSet>(rasterise(*shapes::sphere({0, 0, 0}, 1.0, h), h));
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    motion.translate(Vec3(4.0, 0.0, 0.0)).rotate(Eigen::AngleAxisd(0.7, Vec3::UnitZ()));
    const auto moved = shapes::moved(ball, motion), both = shapes::unite({ball, moved});
    const auto of_moved = moved->probe(), of_both = both->probe();
    for (const auto& surface : {moved, both}) EXPECT_NEAR(surface->reach(), ball->reach(), 1e-12);
    for (const double beyond : {-4.0, -2.0, 2.0, 4.0, 20.0}) {
        const Vec3 from_middle = (1.0 + beyond * h) * Vec3(0.6, 0.0, 0.8);
        const double least = std::min(std::abs(beyond) * h, ball->reach()) - 0.15 * h;
        EXPECT_GE(std::abs(of_moved->farther_value(motion * from_middle)), least) << beyond;
        EXPECT_GE(std::abs(of_both->farther_value(from_middle)), least) << beyond;
        EXPECT_GE(std::abs(of_both->farther_value(motion * from_middle)), least) << beyond;
    }
}

TEST(Shapes, RefuseLengthsThatAreNotPositive) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THROW(shapes::sphere(kCentre, 0.0, 0.1), OptionError);
    EXPECT_THROW(shapes::sphere(kCentre, nan, 0.1), OptionError);
    EXPECT_THROW(shapes::sphere(kCentre, 1.0, nan), OptionError);
    EXPECT_THROW(shapes::sphere({nan, 0, 0}, 1.0, 0.1), OptionError);
    EXPECT_THROW(shapes::ellipsoid(kCentre, {1, -1, 1}, 0.1), OptionError);
    EXPECT_THROW(shapes::torus(kCentre, 0.1, 0.2, 0.1), OptionError);
    EXPECT_THROW(shapes::box(kCentre, {1, 1, 0}, 0.1), OptionError);
    EXPECT_THROW(shapes::plate(kCentre, 0.1, 0.3, 0.1), OptionError);
    EXPECT_THROW(shapes::shell(kCentre, 0.1, 0.1, 0.1), OptionError);
    EXPECT_THROW(shapes::blended_spheres(kCentre, 0.2, kCentre, 0.1, 0.1, 0.1), OptionError);
    EXPECT_THROW(shapes::from_function({}, Box(), 0.1), OptionError);
    EXPECT_THROW(shapes::unite({}), OptionError);
}

}  // namespace
}  // namespace isotrack
