#include "surface/packed_crossings.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace isotrack {
namespace {

/// A lattice that is turned, of uneven spacing, with a shear, and far from the origin.
Eigen::Affine3d some_lattice() {
    Eigen::Affine3d lattice = Eigen::Affine3d::Identity();
    lattice.translate(Vec3(1000.0, -20.0, 3.0));
    lattice.rotate(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()));
    lattice.scale(Vec3(0.1, 0.2, 0.15));
    lattice.linear().col(2) += 0.3 * lattice.linear().col(1);
    return lattice;
}

TEST(PackedCrossings, AreThoseThatWerePacked) {
    const Eigen::Affine3d lattice = some_lattice();
    const Vec3 origin = lattice * Vec3(-10, 0, 5);
    PackedCrossings list(origin, lattice);
    EXPECT_EQ(list.size(), 0u);
    std::mt19937 random(2);
    std::uniform_real_distribution<double> coordinate(0.0, 50.0);
    std::vector<Surface::Crossing> crossings;
    for (int i = 0; i < 100; ++i) {
        const Vec3 p = origin + Vec3(coordinate(random), coordinate(random), coordinate(random));
        const double side = i % 2 == 0 ? 1.0 : -1.0;
        const Vec3 outward = side * lattice.linear().col(i % 3).normalized();
        crossings.push_back({p, outward.cast<float>()});
        list.entries.push_back(list.packed(p, 1u << (i % 3 + (i % 2 == 0 ? 0 : 3))));
    }
    ASSERT_EQ(list.size(), crossings.size());
    for (std::size_t i = 0; i < crossings.size(); ++i) {
        const Vec3& p = crossings[i].point;
        EXPECT_LT((list.point(i) - p).norm(), 1e-7 * (p - origin).norm());
        EXPECT_EQ(list[i].point, list.point(i));
        EXPECT_LT((list[i].outward - crossings[i].outward).norm(), 1e-6f);
    }
}

TEST(PackedCrossings, GoTheMiddleBetweenTheirWays) {
    const Eigen::Affine3d lattice = some_lattice();
    PackedCrossings list(Vec3::Zero(), lattice);
    const auto outward = [&](PackedCrossings::Ways ways) -> Vec3 {
        list.entries.assign(1, list.packed(Vec3::Zero(), ways));
        return list[0].outward.cast<double>();
    };
    const auto along = [&](int axis) -> Vec3 { return lattice.linear().col(axis).normalized(); };
    EXPECT_LT((outward(0b000101) - (along(0) + along(2)).normalized()).norm(), 1e-6);
    EXPECT_LT((outward(0b010000) + along(1)).norm(), 1e-6);
    EXPECT_LT((outward(0b100011) - (along(0) + along(1) - along(2)).normalized()).norm(), 1e-6);
    EXPECT_LT((outward(0b010011) - along(0)).norm(), 1e-6);  // up and down axis 1
    EXPECT_EQ(outward(PackedCrossings::kNoWay), Vec3::Zero());
    const Vec3 one_of_two = outward(0b001001);  // up and down axis 0 alone
    EXPECT_LT(std::min((one_of_two - along(0)).norm(), (one_of_two + along(0)).norm()), 1e-6);
}

}  // namespace
}  // namespace isotrack
