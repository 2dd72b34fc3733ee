#include "delaunay/simultaneous_insertion.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "delaunay/incremental.h"
#include "delaunay/spatial_order.h"
#include "numbers_below.h"
#include "support/gaussian_points.h"

namespace isotrack {
namespace {

using Clouds = std::vector<std::pair<std::string, std::vector<Vec3>>>;

/// Runs `body` with so many threads, which may be more than there are cores.
template <typename Body>
void with_threads(int threads, const Body& body) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    tbb::task_arena arena(threads);
    arena.execute(body);
}

Tetrahedra built_by(int threads, const std::vector<Vec3>& points) {
    Tetrahedra cells;
    with_threads(threads, [&] {
        const auto dt = make_tetrahedralisation(UpdateStrategy::Rebuild);
        dt->assign(points, threads);
        cells = dt->cells();
    });
    return cells;
}

std::vector<Vec3> ball(int n) {
    return support::gaussian_points(n, 1);
}

std::vector<Vec3> bumps(int n) {
    auto points = ball(n);
    for (Vec3& p : points) p = p.normalized() * (1.0 + 0.2 * std::sin(5.0 * p.x()) * std::sin(6.0 * p.y()));
    return points;
}

/// Points of which some threads build a DT, but for the fewest: in general position, on common spheres and
/// planes, with cells that span all of them, and some that see half of the hull.
Clouds clouds() {
    Clouds result;
    const auto inside = ball(12000);
    result.emplace_back("ball", inside);
    auto points = inside;
    for (Vec3& p : points) p = p.normalized().cast<float>().cast<double>();
    result.emplace_back("sphere of floats", points);
    for (int i = 0; i < 60; ++i) points[100 * i] = 20.0 * inside[i];
    result.emplace_back("sphere from afar", points);
    result.emplace_back("bumps", bumps(12000));
    points.clear();
    for (int i = 0; i < 20 * 20 * 20; ++i) points.emplace_back(i / 400, i / 20 % 20, i % 20);
    result.emplace_back("lattice", points);
    points = inside;
    for (Vec3& p : points) p[std::abs(p.x()) > std::abs(p.y()) ? 0 : 1] = p.x() + p.y() > 0.0 ? 1.0 : -1.0;
    result.emplace_back("four planes", points);
    points = inside;
    for (Vec3& p : points) p.z() = p.x() > 0.0 ? 1.0 : 0.0;
    result.emplace_back("two planes", points);
    for (const int n : {1999, 2000, 2001, 3000})  // where more threads come in
        result.emplace_back("ball of " + std::to_string(n), ball(n));
    points = ball(3000);
    for (Vec3& p : points) p.z() = 0.5;
    points.back().z() = 1.0;
    result.emplace_back("plane and a point", points);
    return result;
}

void expect_same(const Tetrahedra& one, const Tetrahedra& other, const std::string& of) {
    EXPECT_GT(one.size(), 0u) << of;
    EXPECT_TRUE(one.vertices == other.vertices) << of;
    EXPECT_TRUE(one.links == other.links) << of;
}

TEST(SimultaneousInsertion, GivesTheCellsOfOneThreadInTheSameOrder) {
    for (const auto& [name, points] : clouds()) {
        const Tetrahedra alone = built_by(1, points);
        for (const int threads : {2, 4, 12, 4})
            expect_same(alone, built_by(threads, points), name + " by " + std::to_string(threads));
    }
}

TEST(SimultaneousInsertion, WorksWithMoreThreadsThanThereAreMarks) {
    const auto points = bumps(130000);
    expect_same(built_by(1, points), built_by(130, points), "bumps");
}

TEST(SimultaneousInsertion, LeavesOutTheSamePointOfTwoOnOnePlace) {
    // One pair at a time, wherever it is met: before there are several threads, by them, or after.
    for (int i = 0; i < 6000; i += 500) {
        std::vector<Vec3> points = ball(6000);
        points.push_back(points[i]);
        expect_same(built_by(1, points), built_by(4, points), "doubled " + std::to_string(i));
    }
}

TEST(SimultaneousInsertion, MakesMoreCellsThanThereIsRoomFor) {
    // Of points on two skew lines each two neighbours of one share a cell with each two of the other.
    constexpr int kOfEach = 300;
    std::vector<Vec3> points = ball(6000);
    for (int i = 0; i < kOfEach; ++i) {
        points.emplace_back(0.01 * i, 0.0, 100.0);
        points.emplace_back(1.5, 0.01 * i - 1.5, 110.0);
    }
    const Tetrahedra alone = built_by(1, points);
    EXPECT_GT(alone.size(), 8 * points.size() + std::size_t{kOfEach} * kOfEach / 2);
    expect_same(alone, built_by(4, points), "two lines");
}

/// What there is when some have been added one after another.
struct Begun {
    std::vector<Vec3> points;
    Tetrahedra cells;
    std::vector<char> marks;
    std::vector<int> free;
    std::vector<int> others;  // along Hilbert's curve

    Begun(std::vector<Vec3> all, int first) : points(std::move(all)) {
        IncrementalDelaunay dt;
        dt.points = points;
        std::vector<int> chosen = numbers_below(first);
        dt.build(chosen, 1);
        dt.arrange();
        cells = dt.cells();
        marks.assign(cells.size(), cell_mark::kUnseen);
        for (int v = first; v < static_cast<int>(points.size()); ++v) others.push_back(v);
        sort_along_curve(points, others);
    }
};

TEST(SimultaneousInsertion, LeavesFew) {
    with_threads(4, [] {
        Begun begun(bumps(12000), 1500);
        SimultaneousInsertion insertion(begun.points, begun.cells, begun.marks, begun.free, 8 * 12000, 4);
        EXPECT_TRUE(insertion.add(begun.others.data(), begun.others.data() + begun.others.size()));
        EXPECT_LT(insertion.finish().size(), begun.others.size() / 2);  // a few where each has a core
        EXPECT_GT(begun.cells.size(), std::size_t{4} * 12000);
    });
}

TEST(SimultaneousInsertion, SaysWherePointsAreDoubled) {
    auto points = ball(4000);
    points[3000] = points[2000];
    Begun begun(points, 1500);
    SimultaneousInsertion insertion(begun.points, begun.cells, begun.marks, begun.free, 8 * 4000, 4);
    const bool none = insertion.add(begun.others.data(), begun.others.data() + begun.others.size());
    const std::vector<int> left = insertion.finish();
    const auto is_left = [&](int v) { return std::find(left.begin(), left.end(), v) != left.end(); };
    EXPECT_EQ(none, is_left(2000) || is_left(3000));
}

TEST(SimultaneousInsertion, LeavesAllWhereThereIsNoRoom) {
    Begun begun(ball(4000), 1500);
    const Tetrahedra before = begun.cells;
    SimultaneousInsertion insertion(begun.points, begun.cells, begun.marks, begun.free, 0, 4);
    EXPECT_TRUE(insertion.add(begun.others.data(), begun.others.data() + begun.others.size()));
    std::vector<int> left = insertion.finish();
    std::sort(left.begin(), left.end());
    std::sort(begun.others.begin(), begun.others.end());
    EXPECT_EQ(left, begun.others);
    expect_same(before, begun.cells, "no room");
    EXPECT_EQ(std::count(begun.marks.begin(), begun.marks.end(), cell_mark::kUnseen),
              static_cast<std::ptrdiff_t>(begun.cells.size()));
}

TEST(SimultaneousInsertion, NumbersCellsByTheirVertices) {
    const Tetrahedra cells = built_by(4, ball(5000));
    const auto order = [](int v) { return static_cast<unsigned>(v); };  // the infinite vertex is the largest
    std::array<int, 4> before{-2, -2, -2, -2};
    for (std::size_t c = 0; c < cells.size(); ++c) {
        const auto& v = cells.vertices[c];
        for (int k = 1; k < 4; ++k) ASSERT_LT(order(v[0]), order(v[k]));
        for (int k = 2; k < 4; ++k) ASSERT_LT(order(v[1]), order(v[k]));
        const auto in_order = [&](const std::array<int, 4>& w) {
            return std::array<unsigned, 3>{order(w[0]), order(w[1]), order(w[2])};
        };
        if (c > 0) {
            ASSERT_LT(in_order(before), in_order(v));
        }
        before = v;
        for (int k = 0; k < 4; ++k) {
            const int n = cells.neighbour(static_cast<int>(c), k),
                      m = cells.mirror_index(static_cast<int>(c), k);
            ASSERT_EQ(cells.links[n][m], Tetrahedra::link(static_cast<int>(c), k));
            for (int j = 0; j < 4; ++j) {
                if (j == k) continue;
                ASSERT_EQ(std::count(cells.vertices[n].begin(), cells.vertices[n].end(), v[j]), 1);
            }
        }
    }
}

}  // namespace
}  // namespace isotrack
