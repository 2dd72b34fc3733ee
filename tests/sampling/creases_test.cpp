// Who is pulled on to a crease, and how particles lie along one.
#include "sampling/creases.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <utility>
#include <vector>

#include "isotrack/sampling/cover.h"
#include "isotrack/sampling/relaxation.h"
#include "isotrack/surface/shapes.h"
#include "support/particles.h"

namespace isotrack {
namespace {

using support::adjacency_of;

constexpr double kResolution = 0.01, kSpacing = 0.2;

struct Pulled {
    Crease crease;
    Vec3 position, normal;
};

/// A particle there with neighbours there, all of the same spacing.
Pulled pulled(const Surface& surface, const Vec3& place, const std::vector<Vec3>& neighbours) {
    const auto probe = surface.probe();
    Particles particles;
    std::vector<int> number;
    particles.add(place, probe->normal(place), kSpacing, 0);
    for (const Vec3& p : neighbours) {
        number.push_back(static_cast<int>(particles.size()));
        particles.add(p, probe->normal(p), kSpacing, number.back());
    }
    const Crease crease = pull_to_crease(particles, {number.data(), number.data() + number.size()}, 0,
                                         surface.resolution(), *probe);
    return {crease, particles.position[0], particles.normal[0]};
}

TEST(PullToCrease, PutsOnTheEdgeWhatIsWithinReach) {
    const auto box = shapes::box({0, 0, 0}, {1, 1, 1}, kResolution);
    const Pulled result = pulled(*box, {1, 0.94, 0.3}, {{0.9, 1, 0.3}, {1, 0.8, 0.3}});
    EXPECT_EQ(result.crease.kind, Crease::Kind::Line);
    EXPECT_LT((result.position - Vec3(1, 1, 0.3)).norm(), 1e-4);
    EXPECT_NEAR(std::abs(result.crease.along.z()), 1.0, 1e-6);
}

TEST(PullToCrease, PutsIntoTheCornerWhatIsWithinReach) {
    const auto box = shapes::box({0, 0, 0}, {1, 1, 1}, kResolution);
    const Pulled result = pulled(*box, {1, 0.98, 0.97}, {{0.9, 1, 0.9}, {0.9, 0.9, 1}});
    EXPECT_EQ(result.crease.kind, Crease::Kind::Corner);
    EXPECT_LT((result.position - Vec3(1, 1, 1)).norm(), 1e-4);
}

TEST(ReturnToCreases, BringsBackWhoHasSlidOffALittle) {
    const auto box = shapes::box({0, 0, 0}, {1, 1, 1}, kResolution);
    const auto probe = box->probe();
    // On an edge, slid off it, in a corner, slid off it, on a face too far from any; and some beside them.
    const std::vector<Vec3> places{{1, 1, 0.3},     {1, 0.985, -0.1}, {1, 1, 1},        {1, 0.995, -0.995},
                                   {1, 0.94, -0.5}, {0.9, 1, 0.1},    {0.85, 0.9, 1.0}, {0.9, 1, -0.9}};
    Particles particles;
    for (const Vec3& p : places) {
        const Vec3 n = p.z() == 1.0 && p.x() < 1.0 ? Vec3(0, 0, 1) : probe->normal(p - 1e-3 * p);
        particles.add(p, n, kSpacing, static_cast<Id>(particles.size()));
    }
    particles.normal[0] = Vec3(1, 0, 0);
    particles.normal[2] = Vec3(1, 0, 0);
    std::vector<std::pair<int, int>> pairs;
    for (int i = 0; i < 8; ++i)
        for (int j = 0; j < 8; ++j)
            if (i != j) pairs.emplace_back(i, j);
    return_to_creases(particles, from_pairs(pairs, places.size()), *box);
    const Vec3 wanted[] = {{1, 1, 0.3}, {1, 1, -0.1}, {1, 1, 1}, {1, 1, -1}, {1, 0.94, -0.5}};
    for (int i = 0; i < 5; ++i)
        EXPECT_LT((particles.position[i] - wanted[i]).norm(), 1e-4) << particles.position[i].transpose();
}

TEST(ReturnToCreases, BringsBackHoweverTheCreaseLies) {
    // Two planes through a line; around a particle they are looked at in some directions, past which a turn
    // takes them.
    constexpr double kDegree = 3.14159265358979323846 / 180.0;
    for (const int between : {60, 70, 80})
        for (int turn = 0; turn < 360; turn += 5) {
            const Eigen::AngleAxisd motion(turn * kDegree, Vec3(1, 2, 3).normalized());
            const Vec3 line = motion * Vec3(0, 0, 1), n = motion * Vec3(1, 0, 0),
                       m = Eigen::AngleAxisd(between * kDegree, line) * n;
            const auto wedge =
                shapes::from_function([=](const Vec3& p) { return std::max(n.dot(p), m.dot(p)); },
                                      Box(Vec3(-1, -1, -1), Vec3(1, 1, 1)), kResolution);
            Particles particles;
            particles.add(0.09 * kSpacing * line.cross(n) * -1.0, n, kSpacing, 0);
            particles.add(0.5 * kSpacing * line.cross(m), m, kSpacing, 1);
            return_to_creases(particles, from_pairs({{0, 1}, {1, 0}}, 2), *wedge);
            EXPECT_LT(particles.position[0].norm(), 0.002 * kSpacing) << between << " " << turn;
        }
}

TEST(ReturnToCreases, BringsNobodyNextToAnother) {
    const auto box = shapes::box({0, 0, 0}, {1, 1, 1}, kResolution);
    for (const double beside : {0.31, 0.4}) {
        Particles particles;
        particles.add({1, 0.99, 0.3}, {1, 0, 0}, kSpacing, 0);
        particles.add({1, 1, beside}, {1, 0, 0}, kSpacing, 1);
        particles.add({0.9, 1, 0.35}, {0, 1, 0}, kSpacing, 2);
        return_to_creases(particles, from_pairs({{0, 1}, {1, 0}, {0, 2}, {2, 0}, {1, 2}, {2, 1}}, 3), *box);
        const Vec3 wanted = beside < 0.35 ? Vec3(1, 0.99, 0.3) : Vec3(1, 1, 0.3);
        EXPECT_LT((particles.position[0] - wanted).norm(), 1e-4) << beside;
    }
}

TEST(ReturnToCreases, LeavesWhatIsSmoothWhereItIs) {
    const auto torus = shapes::torus({0, 0, 0}, 1.0, 0.3, kResolution);
    Particles particles;
    Id next_id = 0;
    cover(particles, *torus, CrossingGrid(*torus), support::limits_of(kSpacing), 1, next_id);
    const Particles before = particles;
    return_to_creases(particles, adjacency_of(particles), *torus);
    EXPECT_EQ(particles.position, before.position);
}

TEST(PullToCrease, LeavesAloneWhereAnotherIsOrNobodyFacesAnotherWay) {
    const auto box = shapes::box({0, 0, 0}, {1, 1, 1}, kResolution);
    const Vec3 place(1, 0.94, 0.3), across(0.9, 1, 0.3);
    const Pulled taken = pulled(*box, place, {across, {1, 1, 0.3 + 0.7 * kSpacing}});
    EXPECT_EQ(taken.crease.kind, Crease::Kind::None);
    EXPECT_EQ(taken.position, place);
    EXPECT_EQ(pulled(*box, place, {across, {1, 1, 0.3 + 0.9 * kSpacing}}).crease.kind, Crease::Kind::Line);
    const Pulled flat = pulled(*box, place, {{1, 0.8, 0.3}});
    EXPECT_EQ(flat.crease.kind, Crease::Kind::None);
    EXPECT_EQ(flat.position, place);
}

TEST(PullToCrease, LeavesAloneWhatIsFartherOrSmooth) {
    const Vec3 beside(1, 1 - 0.45 * kSpacing, 0.3);
    // Even where the resolution makes it look farther than it may go.
    for (const double resolution : {kResolution, 0.6 * kSpacing}) {
        const auto surface = shapes::box({0, 0, 0}, {1, 1, 1}, resolution);
        const Pulled far = pulled(*surface, beside, {{0.9, 1, 0.3}, {1, 0.8, 0.3}});
        EXPECT_EQ(far.crease.kind, Crease::Kind::None);
        EXPECT_EQ(far.position, beside);
    }

    const auto sphere = shapes::sphere({0, 0, 0}, 0.5, kResolution);
    const Vec3 top(0, 0, 0.5), turned = 0.5 * Vec3(0.4, 0, 0.9).normalized();
    const Pulled round = pulled(*sphere, top, {turned});
    EXPECT_EQ(round.crease.kind, Crease::Kind::None);
    EXPECT_EQ(round.position, top);
}

TEST(Relax, LaysParticlesAlongCreasesAndClearOfThem) {
    const auto box = shapes::box({0, 0, 0}, {1, 1, 1}, kResolution);
    const auto probe = box->probe();
    std::mt19937 random(5);
    std::uniform_real_distribution<double> across(-1.0, 1.0);
    constexpr double kOn = 0.02 * kSpacing;
    Particles particles;
    for (int i = 0; i < 690; ++i) {  // as many as hexagons of that spacing have on 24 units of area
        Vec3 p(across(random), across(random), across(random));
        p[i % 3] = i % 2 == 0 ? 1.0 : -1.0;
        particles.add(p, probe->normal(p), kSpacing, i);
    }
    for (int round = 0; round < 8; ++round) relax(particles, adjacency_of(particles), *box, 3);

    std::array<std::vector<double>, 4> on_edge;  // along the third axis
    std::size_t between = 0;                     // neither on a crease nor clear of it
    for (const Vec3& p : particles.position) {
        std::array<double, 3> below = {1 - std::abs(p.x()), 1 - std::abs(p.y()), 1 - std::abs(p.z())};
        if (std::max(below[0], below[1]) < kOn) on_edge[2 * (p.x() > 0) + (p.y() > 0)].push_back(p.z());
        std::sort(below.begin(), below.end());
        between += below[1] > kOn && below[1] < 0.35 * kSpacing;
    }
    EXPECT_LE(between, particles.size() / 50);  // when scattered: a seventh
    for (auto& along : on_edge) {
        std::sort(along.begin(), along.end());
        ASSERT_GE(along.size(), 8U);
        EXPECT_NEAR(along.front(), -1.0, 1.5 * kSpacing);
        EXPECT_NEAR(along.back(), 1.0, 1.5 * kSpacing);
        for (std::size_t i = 1; i < along.size(); ++i) EXPECT_LT(along[i] - along[i - 1], 2.2 * kSpacing);
    }
}

}  // namespace
}  // namespace isotrack
