// Ways along velocity fields, against the exact solutions.
#include "tracking/advection.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

namespace isotrack {
namespace {

constexpr double kVoxel = 0.1;
using Field = std::function<Vec3(const Vec3&)>;

/// A field at the voxels of a cube around `middle`; elsewhere the background.
openvdb::Vec3SGrid::Ptr field_around(const Vec3& middle, int reach, const Field& velocity,
                                     double voxel = kVoxel, const Vec3& background = Vec3::Zero()) {
    const auto grid = openvdb::Vec3SGrid::create(openvdb::Vec3s(openvdb::Vec3d(background.data())));
    grid->setTransform(openvdb::math::Transform::createLinearTransform(voxel));
    const openvdb::Coord centre = openvdb::Coord::round(grid->worldToIndex(openvdb::Vec3d(middle.data())));
    auto accessor = grid->getAccessor();
    const openvdb::CoordBBox cube(centre.offsetBy(-reach), centre.offsetBy(reach));
    for (auto at = cube.begin(); at; ++at) {
        const Vec3 v = velocity(Vec3(grid->indexToWorld(*at).asPointer()));
        accessor.setValue(*at, openvdb::Vec3s(openvdb::Vec3d(v.data())));
    }
    return grid;
}

Field everywhere(const Vec3& v) {
    return [v](const Vec3&) { return v; };
}

TEST(Advection, GoesOnWhereTheFieldIsNotKnown) {
    const Vec3 p(0.04, -0.03, 0.0);
    // Halfway just within what the field knows, just beyond its last voxel, and far. What is there is not
    // active.
    for (const double length : {0.64, 0.68, 0.72, 3.0})
        for (const Vec3& background : {Vec3(0.0, 0.0, 0.0), Vec3(0.8 * length, 0.0, 0.0)}) {
            const Vec3 v(length, 0.0, 0.0);
            const auto field = field_around(Vec3::Zero(), 3, everywhere(v), kVoxel, background);
            EXPECT_LT((motion_along(field, nullptr, 1.0)(p) - (p + v)).norm(), 1e-6) << length;
            EXPECT_LT((motion_along(field, field, 1.0)(p) - (p + v)).norm(), 1e-6) << length;
        }
}

TEST(Advection, RestsWithoutAVelocity) {
    const auto motion =
        motion_along(field_around(Vec3::Zero(), 3, everywhere({3.0, 1.0, 0.0})), nullptr, 1.0);
    const Vec3 far(5.0, 0.0, 0.0);
    EXPECT_EQ(motion(far), far);
    const auto broken = everywhere({std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0});
    EXPECT_EQ(motion_along(field_around(Vec3::Zero(), 3, broken), nullptr, 1.0)(Vec3::Zero()), Vec3::Zero());
}

TEST(Advection, TakesTheNearestValueForAStartThatIsNotKnown) {
    const Vec3 background(0.3, 0.0, 0.2), own(0.0, 0.4, 0.0), far(5.0, 0.0, 0.0), near(0.96, 0.0, 0.0);
    const auto field = field_around(Vec3::Zero(), 3, everywhere(own), kVoxel, background);
    field->tree().setValueOff(openvdb::Coord(10, 0, 0), openvdb::Vec3s(0.0f, 0.4f, 0.0f));
    const auto motion = motion_along(field, nullptr, 2.0);
    EXPECT_LT((motion(far) - (far + 2.0 * background)).norm(), 1e-6);
    EXPECT_LT((motion(near) - (near + 2.0 * own)).norm(), 1e-6);
}

TEST(Advection, PassesOverWhatIsNotFiniteOrAbsurd) {
    const Vec3 v(0.2, 0.0, 0.0);
    const auto field = field_around(Vec3::Zero(), 3, everywhere(v));
    const float nan = std::numeric_limits<float>::quiet_NaN();
    field->tree().setValueOn(openvdb::Coord(1, 1, 1), openvdb::Vec3s(nan, nan, nan));
    EXPECT_LT((motion_along(field, nullptr, 1.0)(Vec3::Zero()) - v).norm(), 1e-6);
    const auto absurd = field_around(Vec3::Zero(), 3, everywhere({1e30, 0.0, 0.0}));
    EXPECT_TRUE(motion_along(absurd, absurd, 1.0)(Vec3::Zero()).allFinite());
    EXPECT_EQ(motion_along(field, nullptr, 1.0)(Vec3(1e30, 0.0, 0.0)), Vec3(1e30, 0.0, 0.0));
}

TEST(Advection, DropsDoNotTakeWhatTheyFlyPastForTheirOwn) {
    // Halfway the drop meets water that rests, and so it does where it comes to; or nobody knows.
    const Vec3 v(0.0, 0.0, -2.0), end(0.0, 0.0, -2.0);
    const auto before = field_around(Vec3::Zero(), 3, everywhere(v));
    before->merge(*field_around({0.0, 0.0, -1.0}, 3, everywhere(Vec3::Zero())));
    const double nan = std::numeric_limits<double>::quiet_NaN();
    for (const double there : {0.0, nan}) {
        const auto after = field_around(end, 3, everywhere({0.0, 0.0, there}));
        EXPECT_LT((motion_along(before, after, 1.0)(Vec3::Zero()) - end).norm(), 1e-6);
    }
}

TEST(Advection, FollowsAParabolaByTheFieldsOfBothFrames) {
    constexpr double kTime = 0.5;
    const Vec3 p(0.02, 0.0, 0.01), v(2.0, 0.0, 3.0), g(0.0, 0.0, -0.9);
    const Vec3 exact = p + kTime * v + 0.5 * kTime * kTime * g;
    const auto before = field_around(p, 3, everywhere(v)),
               after = field_around(exact, 3, everywhere(v + kTime * g), 0.7 * kVoxel);
    EXPECT_LT((motion_along(before, after, kTime)(p) - exact).norm(), 1e-6);
    EXPECT_GT((motion_along(before, nullptr, kTime)(p) - exact).norm(), kVoxel);  // it matters
}

TEST(Advection, ComesNearTheEndThatAgreesWithTheFieldThere) {
    // The next field grows along the way: the end x is where x - p = (v + w(x)) / 2.
    constexpr double kRate = 0.4, kMore = 0.3;
    const Vec3 v(1.0, 0.0, 0.0);
    const auto before = field_around(Vec3::Zero(), 4, everywhere(v));
    const auto after = field_around(
        v, 6, [&](const Vec3& x) -> Vec3 { return v + Vec3(kMore + kRate * (x.x() - 1.0), 0.0, 0.0); });
    const double exact = 1.0 + 0.5 * kMore / (1.0 - 0.5 * kRate),
                 after_two = motion_along(before, after, 1.0)(Vec3::Zero()).x();
    EXPECT_LT(std::abs(after_two - exact), 1.01 * 0.25 * kRate * kRate * (exact - 1.0));
}

TEST(Advection, IsOfSecondOrderInARotation) {
    const auto turn = [](const Vec3& x) { return Vec3(-x.y(), x.x(), 0.0); };
    const auto field = field_around(Vec3::Zero(), 30, turn);
    const Vec3 p(2.0, 0.0, 0.0);
    for (const auto& after : {openvdb::Vec3SGrid::Ptr(), field}) {
        const auto error = [&](double time) {
            const Vec3 exact(2.0 * std::cos(time), 2.0 * std::sin(time), 0.0);
            return (motion_along(field, after, time)(p) - exact).norm();
        };
        EXPECT_LT(error(0.4), 0.03);
        EXPECT_LT(error(0.2), error(0.4) / 6.0);  // an eighth, of the third order in one step
    }
}

TEST(Advection, KnowsThatStaggeredValuesAreOnFaces) {
    // Each component at the middle of the lower face across its axis.
    Mat3 rate;
    rate << 0.3, -0.1, 0.2, 0.4, -0.2, 0.1, -0.3, 0.2, 0.5;
    const auto field = field_around(Vec3::Zero(), 20, [&](const Vec3& x) {
        Vec3 v;
        for (int a = 0; a < 3; ++a) v[a] = rate.row(a).dot(x - 0.5 * kVoxel * Vec3::Unit(a));
        return v;
    });
    field->setGridClass(openvdb::GRID_STAGGERED);
    const Vec3 p(0.51, -0.33, 0.27);
    constexpr double kTime = 1e-3;
    EXPECT_LT(((motion_along(field, nullptr, kTime)(p) - p) / kTime - rate * p).norm(), 1e-3);
}

}  // namespace
}  // namespace isotrack
