// What every surface gets for free: O1, O2 and the scan for crossings, held against formulas.
#include "isotrack/surface/surface.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "isotrack/surface/crossing_grid.h"
#include "isotrack/surface/shapes.h"
#include "surface/surface_near.h"

namespace isotrack {
namespace {

using shapes::SurfacePtr;
constexpr double kResolution = 0.05, kEpsilon = 1e-8;

/// A surface as its value and gradient alone, so that the default O1 and O2 are at work.
class Plain final : public Surface {
public:
    /// `slope`: what value and gradient are multiplied by, as if the unit were wrong.
    explicit Plain(SurfacePtr surface, double slope = 1.0) : surface_(std::move(surface)), slope_(slope) {}
    std::unique_ptr<Surface::Probe> probe() const override {
        return std::make_unique<Hidden>(*surface_, slope_);
    }
    double resolution() const override { return surface_->resolution(); }
    Box bounds() const override { return surface_->bounds(); }

private:
    class Hidden final : public Surface::Probe {
    public:
        Hidden(const Surface& surface, double slope)
            : Probe(kEpsilon, surface.resolution()), probe_(surface.probe()), slope_(slope) {}
        double value(const Vec3& p) override { return slope_ * probe_->value(p); }
        Surface::Sample sample(const Vec3& p) override {
            const Surface::Sample s = probe_->sample(p);
            return {slope_ * s.value, slope_ * s.gradient};
        }

    private:
        std::unique_ptr<Surface::Probe> probe_;
        double slope_;
    };
    SurfacePtr surface_;
    double slope_;
};

std::vector<SurfacePtr> some_shapes() {
    return {shapes::sphere({0.1, 0.2, 0.3}, 0.8, kResolution),
            shapes::torus({0, 0, 0}, 0.8, 0.3, kResolution),
            shapes::ellipsoid({0, 0.1, 0}, {0.9, 0.6, 0.5}, kResolution)};
}

/// Places within `distance` of a surface, in space.
std::vector<Vec3> places_near(const Surface& surface, double distance, std::size_t count) {
    std::mt19937 random(4);
    std::uniform_real_distribution<double> u(0.0, 1.0);
    const auto probe = surface.probe();
    const Vec3 low = surface.bounds().min() - Vec3::Constant(distance),
               size = surface.bounds().max() + Vec3::Constant(distance) - low;
    std::vector<Vec3> places;
    while (places.size() < count) {
        const Vec3 p = low + size.cwiseProduct(Vec3(u(random), u(random), u(random)));
        if (std::abs(probe->value(p)) < distance) places.push_back(p);
    }
    return places;
}

TEST(Surface, HasItsOwnValuesAtTheCornersOfCells) {
    for (const SurfacePtr& surface : some_shapes()) {
        const auto probe = Plain(surface).probe();
        const Eigen::Affine3d lattice = Plain(surface).lattice();
        const auto formula = surface->probe();
        for (const Vec3& place : places_near(*surface, 0.2, 100)) {
            const Vec3 low = (lattice.inverse() * place).array().floor();
            const auto values = probe->cell_values(low, lattice);
            for (int k = 0; k < 8; ++k)
                EXPECT_EQ(values[k], formula->value(lattice * (low + Vec3(k % 2, k / 2 % 2, k / 4))));
        }
    }
}

TEST(Projection, LandsOnTheSurfaceNextToWhereItStarted) {
    for (const SurfacePtr& shape : some_shapes()) {
        const auto truth = shape->probe(), probe = Plain(shape).probe();
        for (const Vec3& p : places_near(*shape, 0.15, 2000)) {
            const auto q = probe->project(p), closest = truth->project(p);
            ASSERT_TRUE(q);
            ASSERT_TRUE(closest);
            EXPECT_LE(std::abs(truth->value(*q)), kEpsilon);
            // An exact distance leads straight to the closest point.
            EXPECT_LT((*q - *closest).norm(), 1e-5) << p.transpose();
            EXPECT_NEAR((*q - p).norm(), std::abs(truth->value(p)), 1e-5);
        }
    }
}

TEST(Projection, FindsTheWayWhenTheUnitIsWrong) {
    const auto shape = shapes::sphere({0, 0, 0}, 0.8, kResolution);
    for (const double slope : {0.05, 0.5, 3.0, 20.0}) {
        const auto probe = Plain(shape, slope).probe();
        for (const Vec3& p : places_near(*shape, 0.15, 200)) {
            const auto q = probe->project(p);
            ASSERT_TRUE(q) << slope;
            EXPECT_NEAR(q->norm(), 0.8, kEpsilon / slope * 1.01 + 1e-12);
            EXPECT_GT(q->normalized().dot(p.normalized()), 1.0 - 1e-9);
        }
    }
}

TEST(Projection, FindsTheWayOnAFunctionThatIsNoDistance) {
    // x^2 + y^2 + z^2 - 1: a gradient of 0 at the centre, of 2 on the sphere, and curved on the way.
    const auto surface = shapes::from_function([](const Vec3& p) { return p.squaredNorm() - 1.0; },
                                               Box(Vec3::Constant(-1.0), Vec3::Constant(1.0)), kResolution);
    const auto probe = surface->probe();
    std::mt19937 random(6);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> radius(0.5, 1.8);
    for (int i = 0; i < 1000; ++i) {
        const Vec3 direction = Vec3(normal(random), normal(random), normal(random)).normalized();
        const auto q = probe->project(radius(random) * direction);
        ASSERT_TRUE(q);
        EXPECT_LT((*q - direction).norm(), 1e-3 * kResolution);
    }
}

TEST(Projection, GivesUpWhereThereIsNoWay) {
    struct Case {
        const char* name;
        double value;
        Vec3 gradient;
    };
    /// Everywhere the same value and gradient.
    class Flat final : public Surface::Probe {
    public:
        Flat(double value, const Vec3& gradient)
            : Probe(kEpsilon, kResolution), value_(value), gradient_(gradient) {}
        double value(const Vec3&) override { return value_; }
        Surface::Sample sample(const Vec3&) override { return {value_, gradient_}; }

    private:
        double value_;
        Vec3 gradient_;
    };
    const double nan = std::numeric_limits<double>::quiet_NaN();
    for (const Case& c :
         {Case{"outside the band", 0.15, Vec3::Zero()}, Case{"inside the band", -0.15, Vec3::Zero()},
          Case{"never nearer", 0.15, Vec3(1, 0, 0)}, Case{"hardly a gradient", 0.15, Vec3(1e-5, 0, 0)},
          Case{"no number", nan, Vec3(1, 0, 0)}, Case{"no gradient", 0.15, Vec3(nan, nan, nan)}}) {
        Flat probe(c.value, c.gradient);
        EXPECT_FALSE(probe.project(Vec3::Zero())) << c.name;
    }
    const auto probe = Plain(shapes::sphere({0, 0, 0}, 0.8, kResolution)).probe();
    EXPECT_FALSE(probe->project({nan, 0, 0}));
    // Too far: forty steps of one resolution do not get there.
    EXPECT_FALSE(probe->project({0.8 + 60 * kResolution, 0, 0}));
    // On the surface already: stays.
    EXPECT_EQ(*probe->project({0.8, 0, 0}), Vec3(0.8, 0, 0));
}

/// The half space x < `at`, whose gradient points along the surface: Newton's method finds no way.
class Astray final : public Surface::Probe {
public:
    explicit Astray(double at) : Probe(kEpsilon, kResolution), at_(at) {}
    double value(const Vec3& p) override { return p.x() - at_; }
    Surface::Sample sample(const Vec3& p) override { return {value(p), Vec3::UnitY()}; }

private:
    double at_;
};

TEST(SurfaceNear, IsTheProjectionWhereThereIsOne) {
    const auto probe = Plain(shapes::sphere({0, 0, 0}, 0.8, kResolution)).probe();
    const Vec3 p = 0.82 * Vec3(1, 2, 3).normalized();
    EXPECT_EQ(*surface_near(*probe, p, 0.03), *probe->project(p));
    EXPECT_FALSE(surface_near(*probe, p, 0.01));
}

TEST(SurfaceNear, LooksAroundWhereThereIsNone) {
    for (const double at : {0.3, -0.3}) {
        Astray probe(at);
        ASSERT_FALSE(probe.project(Vec3::Zero()));
        const auto found = surface_near(probe, Vec3::Zero(), 0.5);
        ASSERT_TRUE(found);
        EXPECT_NEAR((*found - Vec3(at, 0, 0)).norm(), 0.0, 1e-6);  // along an axis it is nearest
        EXPECT_FALSE(surface_near(probe, Vec3::Zero(), 0.29));
    }
    // A slab thinner than the steps along a segment is found if a step ends in it, else stepped over.
    class Slab final : public Surface::Probe {
    public:
        Slab() : Probe(kEpsilon, kResolution) {}
        double value(const Vec3& p) override { return std::abs(p.x() - 0.25) - 0.01; }
        Surface::Sample sample(const Vec3& p) override { return {value(p), Vec3::Zero()}; }
    } slab;
    const auto found = surface_near(slab, Vec3::Zero(), 0.5);
    ASSERT_TRUE(found);
    EXPECT_NEAR((*found - Vec3(0.24, 0, 0)).norm(), 0.0, 1e-6);
}

TEST(Normal, IsTheUnitOutwardGradient) {
    for (const SurfacePtr& shape : some_shapes()) {
        const auto truth = shape->probe();
        for (const double slope : {1.0, 7.0}) {
            const auto probe = Plain(shape, slope).probe();
            for (const Vec3& p : places_near(*shape, 0.1, 500)) {
                const Vec3 n = probe->normal(p);
                EXPECT_NEAR(n.norm(), 1.0, 1e-12);
                EXPECT_GT(truth->value(p + 0.01 * n), truth->value(p));
                // From the closest point to here, or back.
                const Vec3 way = p - *truth->project(p);
                if (way.norm() > 1e-3) {
                    EXPECT_LT(n.cross(way.normalized()).norm(), 1e-3);
                }
            }
        }
    }
}

TEST(Normal, IsZeroWithoutAGradient) {
    const auto constant = shapes::from_function([](const Vec3&) { return 1.0; },
                                                Box(Vec3::Constant(-1.0), Vec3::Constant(1.0)), kResolution);
    EXPECT_TRUE(constant->probe()->normal(Vec3::Zero()).isZero());
    EXPECT_FALSE(constant->probe()->project(Vec3::Zero()));
    EXPECT_TRUE(constant->crossings().empty());
}

TEST(Crossings, AreThoseOfALatticeAroundTheBounds) {
    for (const SurfacePtr& shape : some_shapes()) {
        const Plain surface(shape);
        const auto crossings = surface.crossings();
        ASSERT_GT(crossings.size(), 1000u);
        // The lattice is not told, but a crossing shows two of its coordinates for each axis. Taken from all
        // of them, and each of its edges counted one by one.
        const auto probe = surface.probe();
        Vec3 node = Vec3::Zero();
        for (const auto& c : crossings)
            for (int axis = 0; axis < 3; ++axis)
                if (c.outward[axis] == 0.0f) node[axis] = c.point[axis];
        std::size_t count = 0;
        const double h = kResolution;
        const Vec3 low = shape->bounds().min() - Vec3::Constant(2 * h),
                   high = shape->bounds().max() + Vec3::Constant(2 * h);
        const Vec3 first = node.array() - ((node - low).array() / h).floor() * h;
        const Eigen::Array3i n = ((high - first).array() / h).floor().cast<int>() + 1;
        for (int x = 0; x < n[0]; ++x)
            for (int y = 0; y < n[1]; ++y)
                for (int z = 0; z < n[2]; ++z) {
                    const Vec3 p = first + h * Vec3(x, y, z);
                    const bool inside = probe->value(p) < 0.0;
                    for (int axis = 0; axis < 3; ++axis)
                        count += inside != (probe->value(p + h * Vec3::Unit(axis)) < 0.0);
                }
        // Nodes may lie within rounding of the surface, on one side here and on the other there.
        EXPECT_NEAR(static_cast<double>(crossings.size()), static_cast<double>(count), 6.0);
        for (const auto& c : crossings) {
            EXPECT_LT(std::abs(probe->value(c.point)), h * h);  // linear interpolation
            EXPECT_EQ(c.outward.norm(), 1.0f);
            EXPECT_GT(probe->value(c.point + h * c.outward.cast<double>()),
                      probe->value(c.point - h * c.outward.cast<double>()));
        }
    }
}

TEST(Crossings, AreSymmetricAndAlwaysInTheSameOrder) {
    const Plain surface(shapes::sphere({0, 0, 0}, 0.8, kResolution));
    const auto a = surface.crossings(), b = surface.crossings();
    ASSERT_EQ(a.size(), b.size());
    Vec3 sum = Vec3::Zero();
    std::array<std::size_t, 6> directions{};
    for (std::size_t i = 0; i < a.size(); ++i) {
        EXPECT_EQ(a[i].point, b[i].point);
        EXPECT_EQ(a[i].outward, b[i].outward);
        sum += a[i].point;
        for (int axis = 0; axis < 3; ++axis) {
            if (a[i].outward[axis] > 0.5f) ++directions[2 * axis];
            if (a[i].outward[axis] < -0.5f) ++directions[2 * axis + 1];
        }
    }
    EXPECT_LT(sum.norm() / static_cast<double>(a.size()), 1e-3);
    // Seen along an axis the sphere is a disk: its area over that of a lattice square.
    for (const std::size_t count : directions)
        EXPECT_NEAR(static_cast<double>(count), 3.14159265 * 0.64 / (kResolution * kResolution), 40.0);
}

TEST(Crossings, SeeEveryPartWiderThanALatticeCell) {
    std::mt19937 random(8);
    std::uniform_real_distribution<double> u(-1.0, 1.0);
    for (int i = 0; i < 50; ++i) {
        // The ball around a cube of one lattice cell holds a node wherever it is.
        const Vec3 centre(u(random), u(random), u(random));
        const auto drop = shapes::sphere(centre, 0.5 * std::sqrt(3.0) * kResolution * 1.001, kResolution);
        const auto surface = shapes::unite({shapes::sphere({0, 0, 5}, 0.4, kResolution), drop});
        std::size_t found = 0;
        for (const auto& c : surface->crossings()) found += (c.point - centre).norm() < 2.0 * kResolution;
        EXPECT_GE(found, 6u);
    }
}

TEST(CrossingGrid, FindsWhatIsInABoxAndNothingElse) {
    const auto surface =
        shapes::unite({shapes::sphere({0, 0, 0}, 1.0, 0.1), shapes::sphere({9, 5, -4}, 0.3, 0.1)});
    const auto all = surface->crossings();
    for (const double width : {0.01, 0.2, 100.0}) {
        const CrossingGrid grid(all, width);
        ASSERT_EQ(grid.size(), all.size());
        for (const Box& box :
             {Box(Vec3(-0.51, -0.21, 0.31), Vec3(0.41, 0.91, 1.21)),  // off the lattice: points are rounded
              Box(Vec3(-9, -9, -9), Vec3(99, 99, 99)), Box(Vec3(8.91, 4, -5), Vec3(9.11, 6, -3)),
              Box(Vec3(3, 3, 3), Vec3(4, 4, 4)), Box(Vec3(-50, -1, -1), Vec3(-40, 1, 1))}) {
            std::size_t expected = 0, found = 0;
            for (const auto& c : all) expected += box.contains(c.point);
            std::set<std::size_t> seen;
            grid.for_each_in(box, [&](std::size_t c) {
                EXPECT_TRUE(box.contains(grid[c].point));
                EXPECT_LT(std::abs(surface->probe()->value(grid[c].point)), 0.01);
                EXPECT_TRUE(seen.insert(c).second);
                ++found;
            });
            EXPECT_EQ(found, expected);
        }
    }
    CrossingGrid(std::vector<Surface::Crossing>(), 1.0)
        .for_each_in(Box(Vec3(-1, -1, -1), Vec3(1, 1, 1)), [](std::size_t) { FAIL(); });
}

}  // namespace
}  // namespace isotrack
