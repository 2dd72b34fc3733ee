// Who may move at once, and where the particles come to rest.
#include "isotrack/sampling/relaxation.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "isotrack/sampling/cover.h"
#include "isotrack/surface/shapes.h"
#include "support/particles.h"

namespace isotrack {
namespace {

using support::adjacency_of;
using support::along_tube;
using support::limits_of;
using support::nearest_distance;
using support::random_on_unit_sphere;

TEST(ColourGroups, HoldEveryParticleOnceAndNoNeighboursInTwoBlocks) {
    const Particles particles = random_on_unit_sphere(500, 0.15);
    const Adjacency adjacency = adjacency_of(particles);
    for (const int longest : {1, 3, 500}) {
        std::vector<int> colour(particles.size(), -1), begin(particles.size());
        const auto groups = colour_groups(adjacency, longest);
        for (std::size_t g = 0; g < groups.size(); ++g)
            for (const ParticleBlock& block : groups[g]) {
                ASSERT_LE(block.end - block.begin, longest);
                for (int i = block.begin; i < block.end; ++i) {
                    EXPECT_EQ(colour[i], -1);
                    colour[i] = static_cast<int>(g);
                    begin[i] = block.begin;
                }
            }
        for (std::size_t i = 0; i < particles.size(); ++i) {
            ASSERT_GE(colour[i], 0);
            for (const int j : adjacency.of(i)) ASSERT_TRUE(begin[i] == begin[j] || colour[i] != colour[j]);
        }
    }
}

TEST(ColourGroups, HaveLongBlocksWhereNeighboursFollowEachOther) {
    std::vector<std::pair<int, int>> pairs;  // two chains
    for (const auto& [from, to] : {std::pair(0, 30), std::pair(30, 50)})
        for (int i = from; i + 1 < to; ++i) {
            pairs.emplace_back(i, i + 1);
            pairs.emplace_back(i + 1, i);
        }
    const Adjacency chains = from_pairs(pairs, 50);
    const auto groups = colour_groups(chains, 20);
    ASSERT_EQ(groups.size(), 2u);  // the two blocks of a chain differ
    ASSERT_EQ(groups[0].size(), 2u);
    ASSERT_EQ(groups[1].size(), 1u);
    const auto spans = [](const ParticleBlock& block, int begin, int end) {
        return block.begin == begin && block.end == end;
    };
    EXPECT_TRUE(spans(groups[0][0], 0, 20) && spans(groups[1][0], 20, 30) && spans(groups[0][1], 30, 50));
    const auto whole = colour_groups(chains, std::numeric_limits<int>::max());
    ASSERT_EQ(whole.size(), 1u);
    ASSERT_EQ(whole[0].size(), 2u);
    EXPECT_TRUE(spans(whole[0][0], 0, 30) && spans(whole[0][1], 30, 50));
}

TEST(ColourGroups, GiveWhoIsLeftOutAColourAllTheSame) {
    // The neighbours of the two that move have no lists.
    const auto groups = colour_groups(from_pairs({{1, 0}, {3, 2}}, 4), 1, {0, 1, 0, 1});
    ASSERT_EQ(groups.size(), 2u);
    EXPECT_TRUE(groups[0].empty());
    ASSERT_EQ(groups[1].size(), 2u);
    EXPECT_EQ(groups[1][0].begin, 1);
    EXPECT_EQ(groups[1][1].begin, 3);
}

TEST(ColourGroups, LeaveOutBlocksInWhichNoFlagIsSet) {
    const Particles particles = random_on_unit_sphere(500, 0.15);
    const Adjacency adjacency = adjacency_of(particles);
    std::vector<char> some(particles.size(), 0);
    some[7] = some[290] = some[291] = 1;
    const auto all = colour_groups(adjacency, 3), of_some = colour_groups(adjacency, 3, some);
    ASSERT_EQ(of_some.size(), all.size());
    std::size_t left_out = 0;
    for (std::size_t g = 0; g < all.size(); ++g) {
        std::vector<int> expected, begins;
        for (const ParticleBlock& block : all[g])
            if (std::find(some.begin() + block.begin, some.begin() + block.end, 1) !=
                some.begin() + block.end)
                expected.push_back(block.begin);
        for (const ParticleBlock& block : of_some[g]) begins.push_back(block.begin);
        EXPECT_EQ(begins, expected);
        left_out += all[g].size() - expected.size();
    }
    EXPECT_GT(left_out, 100u);
}

TEST(Relax, SpreadsRandomPointsAndKeepsThemOnTheSurface) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    Particles particles = random_on_unit_sphere(400, 0.2);
    const auto mean_nearest = [&] {
        double sum = 0.0;
        for (std::size_t i = 0; i < particles.size(); ++i) sum += nearest_distance(particles, i);
        return sum / static_cast<double>(particles.size());
    };
    const double before = mean_nearest();
    for (int round = 0; round < 10; ++round) relax(particles, adjacency_of(particles), *sphere, 3);
    // A hexagonal packing of 400 points would have them 0.19 apart.
    EXPECT_GT(mean_nearest(), 1.5 * before);
    EXPECT_GT(mean_nearest(), 0.75 * 0.19);
    for (std::size_t i = 0; i < particles.size(); ++i) {
        EXPECT_NEAR(particles.position[i].norm(), 1.0, 1e-4);
        EXPECT_LT((particles.normal[i] - particles.position[i].normalized()).norm(), 1e-4);
    }
}

TEST(Relax, PacksNearlyAsDenselyAsHexagons) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    const std::size_t count = 600;
    const double ideal = std::sqrt(8.0 * 3.14159265358979 / (std::sqrt(3.0) * static_cast<double>(count)));
    Particles particles = random_on_unit_sphere(count, ideal);
    for (int sweep = 0; sweep < 30; ++sweep) relax(particles, adjacency_of(particles), *sphere, 1);
    double least = 1e300;
    for (std::size_t i = 0; i < count; ++i) least = std::min(least, nearest_distance(particles, i));
    EXPECT_GE(least, 0.75 * ideal);
}

TEST(Relax, FollowsTheSpacingThatIsAskedFor) {
    // Twice as dense on the right as on the left.
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    Particles particles = random_on_unit_sphere(800, 0.1);
    const auto wanted = [](const Vec3& p) { return 0.12 - 0.04 * p.x(); };
    for (int round = 0; round < 40; ++round) {
        for (std::size_t i = 0; i < particles.size(); ++i)
            particles.spacing[i] = wanted(particles.position[i]);
        relax(particles, adjacency_of(particles), *sphere, 3);
    }
    double left = 0.0, right = 0.0;
    int lefts = 0, rights = 0;
    for (std::size_t i = 0; i < particles.size(); ++i) {
        const double d = nearest_distance(particles, i);
        if (particles.position[i].x() < -0.7) left += d, ++lefts;
        if (particles.position[i].x() > 0.7) right += d, ++rights;
    }
    EXPECT_GT(left / lefts, 1.2 * right / rights);
}

/// How many times longer the edges to the six nearest are along the tube than across it, nearest when lengths
/// along it count sqrt(s) times less and across it more.
double elongation_on_torus(const Particles& particles, double s) {
    double along = 0.0, across = 0.0;
    for (std::size_t i = 0; i < particles.size(); ++i) {
        const Vec3 t = along_tube(particles.position[i]);
        std::vector<std::array<double, 3>> near;  // distance, squares along and across
        for (std::size_t j = 0; j < particles.size(); ++j) {
            if (j == i) continue;
            const Vec3 r = particles.position[j] - particles.position[i];
            const double a = r.dot(t) * r.dot(t), b = r.squaredNorm() - a;
            near.push_back({a / s + b * s, a, b});
        }
        std::nth_element(near.begin(), near.begin() + 5, near.end());
        for (int k = 0; k < 6; ++k) {
            along += near[k][1];
            across += near[k][2];
        }
    }
    return std::sqrt(along / across);
}

TEST(Relax, LeavesMoreRoomAlongTheStretch) {
    const auto torus = shapes::torus({0, 0, 0}, 1.0, 0.3, 0.05);
    for (const double s : {1.0, 1.4}) {
        Particles particles;
        Id next_id = 0;
        cover(particles, *torus, CrossingGrid(*torus), limits_of(0.12), 1, next_id);
        for (int round = 0; round < 12; ++round) {
            for (std::size_t i = 0; i < particles.size(); ++i)
                particles.stretch[i] = std::sqrt(s - 1.0) * along_tube(particles.position[i]);
            relax(particles, adjacency_of(particles), *torus, 3);
        }
        EXPECT_NEAR(elongation_on_torus(particles, s), s, 0.1);
        if (s == 1.0) {  // to look for them along the tube does not put them there
            EXPECT_LT(elongation_on_torus(particles, 1.4), 1.25);
        }
    }
}

TEST(Relax, GivesTheSameBitsAtAnyThreadCount) {
    for (const auto& surface :
         {shapes::torus({0, 0, 0}, 1.0, 0.3, 0.05), shapes::box({0, 0, 0}, {0.5, 0.6, 0.7}, 0.05)}) {
        const auto run = [&](std::size_t threads) {
            const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
            Particles particles;
            Id next_id = 0;
            cover(particles, *surface, CrossingGrid(*surface), limits_of(0.12), 1, next_id);
            for (int round = 0; round < 3; ++round) relax(particles, adjacency_of(particles), *surface, 4);
            std::vector<char> restless;
            for (const Vec3& p : particles.position) restless.push_back(p.x() > 0.1);
            relax(particles, adjacency_of(particles).squared(restless), *surface, 4, restless);
            return particles;
        };
        const Particles one = run(1), two = run(2);
        EXPECT_EQ(one.position, two.position);
        EXPECT_EQ(one.normal, two.normal);
    }
}

TEST(Relax, StopsWhenAllAreAtRest) {
    // The corners of an icosahedron cannot be better placed.
    const double g = 0.5 * (1.0 + std::sqrt(5.0));
    Particles particles;
    for (const double a : {-1.0, 1.0})
        for (const double b : {-g, g})
            for (const Vec3& p : {Vec3(0, a, b), Vec3(a, b, 0), Vec3(b, 0, a)})
                particles.add(p.normalized(), p.normalized(), 1.0, static_cast<Id>(particles.size()));
    const auto start = particles.position;
    EXPECT_LE(relax(particles, adjacency_of(particles), *shapes::sphere({0, 0, 0}, 1.0, 0.1), 50), 3);
    for (std::size_t i = 0; i < start.size(); ++i) EXPECT_LT((particles.position[i] - start[i]).norm(), 0.05);
    EXPECT_EQ(relax(particles, adjacency_of(particles), *shapes::sphere({0, 0, 0}, 1.0, 0.1), 0), 0);
}

TEST(Relax, MovesThoseAloneThatAreRestless) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    Particles particles = random_on_unit_sphere(400, 0.15);
    const Particles before = particles;
    std::vector<char> restless(particles.size());
    for (std::size_t i = 0; i < particles.size(); ++i) restless[i] = particles.position[i].x() > 0.5;
    relax(particles, adjacency_of(particles), *sphere, 3, restless);
    std::size_t moved = 0;
    for (std::size_t i = 0; i < particles.size(); ++i) {
        if (!restless[i]) {
            ASSERT_EQ(particles.position[i], before.position[i]);
        }
        moved += particles.position[i] != before.position[i];
    }
    EXPECT_GT(moved, 50u);
    EXPECT_EQ(relax(particles, adjacency_of(particles), *sphere, 50, std::vector<char>(particles.size(), 0)),
              1);
}

}  // namespace
}  // namespace isotrack
