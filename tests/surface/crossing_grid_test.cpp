#include "isotrack/surface/crossing_grid.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <random>
#include <utility>
#include <vector>

#include "isotrack/surface/shapes.h"

namespace isotrack {
namespace {

constexpr double kResolution = 0.05, kFineResolution = 0.02;
constexpr std::size_t kSeveralBlocks = 3 * 4096;  // of memory, and for several threads

/// Point and direction, to be sorted.
using Row = std::array<double, 6>;

Row row_of(const Surface::Crossing& c) {
    return {c.point.x(), c.point.y(), c.point.z(), c.outward.x(), c.outward.y(), c.outward.z()};
}

TEST(CrossingSequence, HasAPartOfAListInItsOrder) {
    std::vector<Surface::Crossing> list;
    for (int i = 0; i < 130; ++i) list.push_back({Vec3(i, 0.0, 0.0), Eigen::Vector3f::UnitX()});
    const Surface::CrossingSequence sequence(list);
    ASSERT_EQ(sequence.size, list.size());
    for (const std::size_t first : {0, 1, 63, 64, 65, 130})
        for (std::size_t end = first; end <= list.size(); ++end) {
            std::size_t i = first;
            sequence.for_each_in(first, end, [&](const Surface::Crossing& c) {
                EXPECT_EQ(c.point, list[i].point);
                ++i;
            });
            EXPECT_EQ(i, end);
        }
    Surface::CrossingSequence().for_each_in(0, 0, [](const Surface::Crossing&) { FAIL(); });
}

TEST(CrossingGrid, HoldsTheCrossingsOfASurface) {
    const auto torus = shapes::torus({0.1, 0.2, 0.3}, 1.0, 0.4, kResolution);
    std::vector<Row> wanted, found;
    for (const Surface::Crossing& c : torus->crossings()) wanted.push_back(row_of(c));
    const CrossingGrid grid(*torus);
    for (std::size_t c = 0; c < grid.size(); ++c) found.push_back(row_of(grid[c]));
    ASSERT_GT(wanted.size(), 1000u);
    ASSERT_EQ(found.size(), wanted.size());
    const double rounding = 1e-7 * torus->bounds().sizes().maxCoeff();
    // The nearest of either; what is rounded may sort otherwise.
    for (const auto& [of, among] : {std::pair(wanted, found), std::pair(found, wanted)})
        for (std::size_t i = 0; i < of.size(); i += 37)
            EXPECT_TRUE(std::any_of(among.begin(), among.end(), [&, &of = of](const Row& row) {
                for (int k = 0; k < 6; ++k)
                    if (!(std::abs(row[k] - of[i][k]) <= rounding)) return false;
                return true;
            }));
}

TEST(CrossingGrid, IsTheSameAtAnyNumberOfThreads) {
    const auto torus = shapes::torus({0.1, 0.2, 0.3}, 1.0, 0.4, kFineResolution);
    const auto rows = [&](std::size_t threads) {
        const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
        const CrossingGrid grid(*torus);
        std::vector<Row> result;
        for (std::size_t c = 0; c < grid.size(); ++c) result.push_back(row_of(grid[c]));
        return result;
    };
    const std::vector<Row> one = rows(1);
    ASSERT_GT(one.size(), kSeveralBlocks);
    for (int again = 0; again < 5; ++again) EXPECT_EQ(rows(2), one);
}

TEST(CrossingGrid, FindsWhatIsInABox) {
    const auto torus = shapes::torus({0.1, 0.2, 0.3}, 1.0, 0.4, kFineResolution);
    const CrossingGrid grid(*torus);
    ASSERT_GT(grid.size(), kSeveralBlocks);
    for (const Vec3& low : {Vec3(-2.0, -2.0, -2.0), Vec3(0.3, 0.1, 0.2), Vec3(1.3, 0.3, -0.1)})
        for (const double size : {0.0, 0.07, 0.5, 9.0}) {
            const Box box(low, low + Vec3(size, 0.7 * size, 1.3 * size));
            std::vector<std::size_t> wanted, found;
            for (std::size_t c = 0; c < grid.size(); ++c)
                if (box.contains(grid[c].point)) wanted.push_back(c);
            grid.for_each_in(box, [&](std::size_t c) { found.push_back(c); });
            std::sort(found.begin(), found.end());
            EXPECT_EQ(found, wanted);
        }
}

TEST(CrossingGrid, KeepsTheDirectionAndWhatACrossingStandsFor) {
    // Few directions and many; with all alone, some on flat sheets, and some that stand for others as well.
    for (const int directions : {6, 256, 257, 1000})
        for (const bool some_flat : {false, true})
            for (const bool some_for_others : {false, true}) {
                constexpr int kCount = 2000;
                std::vector<Surface::Crossing> crossings;
                for (int i = 0; i < kCount; ++i) {
                    const float angle = 0.001f * static_cast<float>(i % directions);
                    Surface::Crossing c{Vec3(0.5 * i, 0.0, 0.0), {std::cos(angle), std::sin(angle), 0.0f}};
                    c.flat = some_flat && i % 2 == 0;
                    if (some_for_others && i % 7 == 0)
                        c.stands_for = static_cast<std::int16_t>(1 + i % 5 * 8191);
                    crossings.push_back(c);
                }
                std::mt19937 random(3);
                std::vector<Surface::Crossing> shuffled = crossings;
                std::shuffle(shuffled.begin(), shuffled.end(), random);
                const CrossingGrid grid(shuffled, 0.5);
                std::vector<int> numbers(kCount / 2);
                std::iota(numbers.begin(), numbers.end(), kCount / 4);
                const CrossingGrid some = grid.some(numbers);
                ASSERT_EQ(grid.size(), crossings.size());
                ASSERT_EQ(some.size(), numbers.size());
                for (const CrossingGrid* of : {&grid, &some}) {
                    for (std::size_t i = 0; i < of->size(); ++i) {
                        const Surface::Crossing found = (*of)[i];
                        const auto& wanted =
                            crossings[static_cast<std::size_t>(std::lround(found.point.x() / 0.5))];
                        EXPECT_NEAR(found.point.x(), wanted.point.x(), 1e-7 * 0.5 * kCount);
                        EXPECT_EQ(found.outward, wanted.outward);
                        EXPECT_EQ(found.stands_for, wanted.stands_for);
                        EXPECT_EQ(found.flat, wanted.flat);
                    }
                }
            }
}

TEST(CrossingGrid, FindsSomeAloneAsWell) {
    const auto torus = shapes::torus({0.1, 0.2, 0.3}, 1.0, 0.4, kResolution);
    const CrossingGrid grid(*torus);
    for (const std::size_t every : {1, 3, 200}) {
        std::vector<int> numbers, wanted;
        for (std::size_t c = grid.size(); c-- > 0;)
            if (c % every == 0) numbers.push_back(static_cast<int>(c));
        std::vector<int> before = numbers;
        const CrossingGrid some = grid.some(numbers);
        ASSERT_EQ(some.size(), numbers.size());
        for (std::size_t i = 0; i < some.size(); ++i) {
            EXPECT_EQ(row_of(some[i]), row_of(grid[numbers[i]]));
            EXPECT_EQ(some[i].stands_for, grid[numbers[i]].stands_for);
        }
        const Box box(Vec3(0.3, 0.1, 0.2), Vec3(0.9, 1.1, 0.8));
        for (const int c : before)
            if (box.contains(grid[c].point)) wanted.push_back(c);
        std::vector<int> found;
        some.for_each_in(box, [&](std::size_t i) { found.push_back(numbers[i]); });
        for (std::vector<int>* list : {&before, &numbers, &wanted, &found})
            std::sort(list->begin(), list->end());
        EXPECT_EQ(numbers, before);
        EXPECT_EQ(found, wanted);
        EXPECT_FALSE(found.empty());
    }
    std::vector<int> none;
    EXPECT_TRUE(grid.some(none).empty());
}

}  // namespace
}  // namespace isotrack
