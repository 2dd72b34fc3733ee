#include "isotrack/delaunay/tetrahedralisation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <set>

#include "isotrack/delaunay/predicates.h"

namespace isotrack {
namespace {

std::vector<Vec3> random_points(std::size_t n, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> u(-1.0, 1.0);
    std::vector<Vec3> points;
    for (std::size_t i = 0; i < n; ++i) points.emplace_back(u(random), u(random), u(random));
    return points;
}

Vec3 circumcentre(const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& s) {
    Mat3 m;
    m << (q - p).transpose(), (r - p).transpose(), (s - p).transpose();
    const Vec3 rhs = 0.5 * Vec3((q - p).squaredNorm(), (r - p).squaredNorm(), (s - p).squaredNorm());
    return p + m.fullPivLu().solve(rhs);
}

std::set<std::array<int, 4>> cell_sets(const Tetrahedra& cells) {
    std::set<std::array<int, 4>> result;
    for (auto cell : cells.vertices) {
        std::sort(cell.begin(), cell.end());
        if (cell[3] < 0) continue;  // a slot without a cell
        result.insert(cell);
    }
    return result;
}

TEST(Tetrahedralise, LeavesEveryCircumsphereEmpty) {
    const auto points = random_points(150, 3);
    const Tetrahedra cells = tetrahedralise(points);
    std::size_t finite = 0;
    for (std::size_t c = 0; c < cells.size(); ++c) {
        if (cells.is_infinite(static_cast<int>(c))) continue;
        ++finite;
        const auto& v = cells.vertices[c];
        const Vec3 o = circumcentre(points[v[0]], points[v[1]], points[v[2]], points[v[3]]);
        const double radius = (points[v[0]] - o).norm();
        for (const Vec3& p : points) EXPECT_GE((p - o).norm(), radius * (1.0 - 1e-9));
    }
    EXPECT_GT(finite, points.size());
}

/// Points with whole coordinates from 0 to `largest`, so that determinants can be had without rounding.
std::vector<Vec3> whole_points(std::size_t n, int largest, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_int_distribution<int> u(0, largest);
    std::set<std::array<int, 3>> seen;
    std::vector<Vec3> points;
    while (points.size() < n) {
        const std::array<int, 3> p{u(random), u(random), u(random)};
        if (seen.insert(p).second) points.emplace_back(p[0], p[1], p[2]);
    }
    return points;
}

using Whole = Eigen::Matrix<std::int64_t, 3, 1>;

Whole to_whole(const Vec3& p) {
    return p.cast<std::int64_t>();
}

/// Positive when v is inside the circumsphere of the positively oriented pqrs. Exact for coordinates up to
/// 1000.
std::int64_t in_sphere(const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& s, const Vec3& v) {
    const Whole w = to_whole(v), a = to_whole(p) - w, b = to_whole(q) - w, c = to_whole(r) - w,
                d = to_whole(s) - w;
    return a.squaredNorm() * b.dot(c.cross(d)) - b.squaredNorm() * a.dot(c.cross(d)) +
           c.squaredNorm() * a.dot(b.cross(d)) - d.squaredNorm() * a.dot(b.cross(c));
}

TEST(Tetrahedralise, IsDelaunayToTheLastBit) {
    std::vector<Vec3> lattice;  // eight points on every cell's sphere
    for (int i = 0; i < 5 * 5 * 5; ++i) lattice.emplace_back(i / 25, i / 5 % 5, i % 5);
    for (const auto& points : {whole_points(250, 1000, 1), whole_points(120, 6, 2), lattice}) {
        // The sign convention, on a tetrahedron and its middle.
        ASSERT_GT(in_sphere({0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {0, 0, 4}, {1, 1, 1}), 0);
        const Tetrahedra cells = tetrahedralise(points);
        double volume6 = 0.0;
        std::set<int> used;
        for (std::size_t c = 0; c < cells.size(); ++c) {
            const auto& v = cells.vertices[c];
            if (cells.is_infinite(static_cast<int>(c))) continue;
            const Vec3 &p = points[v[0]], &q = points[v[1]], &r = points[v[2]], &s = points[v[3]];
            ASSERT_EQ(orientation(p, q, r, s), 1);
            volume6 += (q - p).cross(r - p).dot(s - p);
            used.insert(v.begin(), v.end());
            for (const Vec3& other : points) ASSERT_LE(in_sphere(p, q, r, s, other), 0);
        }
        EXPECT_EQ(used.size(), points.size());
        // Nothing twice and no gap: the cells fill the lattice's cube.
        if (points.size() == lattice.size()) {
            EXPECT_EQ(volume6, 6.0 * 64.0);
        }
    }
}

TEST(Tetrahedralise, GivesTheSameCellsInTheSameOrder) {
    const auto points = random_points(300, 9);
    const Tetrahedra a = tetrahedralise(points), b = tetrahedralise(points);
    EXPECT_EQ(a.vertices, b.vertices);
    EXPECT_EQ(a.links, b.links);
}

TEST(Tetrahedralise, ClosesTheHullByOneInfiniteVertex) {
    const auto points = random_points(100, 10);
    const Tetrahedra cells = tetrahedralise(points);
    for (std::size_t c = 0; c < cells.size(); ++c)
        EXPECT_LE(std::count(cells.vertices[c].begin(), cells.vertices[c].end(), Tetrahedra::kInfinite), 1);
    const Tetrahedra one = tetrahedralise({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}});
    EXPECT_EQ(one.size(), 5u);
    std::size_t infinite = 0;
    for (int c = 0; c < 5; ++c) infinite += one.is_infinite(c);
    EXPECT_EQ(infinite, 4u);
}

TEST(Tetrahedralise, OrientsCellsAndFacetsAndLinksNeighboursBothWays) {
    const auto points = random_points(200, 4);
    const Tetrahedra cells = tetrahedralise(points);
    for (std::size_t c = 0; c < cells.size(); ++c) {
        const auto& v = cells.vertices[c];
        for (int k = 0; k < 4; ++k) {
            const int n = cells.neighbour(c, k), m = cells.mirror_index(static_cast<int>(c), k);
            EXPECT_EQ(cells.neighbour(n, m), static_cast<int>(c));
            // The neighbour has the facet's three vertices and not the one opposite.
            for (int j = 0; j < 4; ++j)
                if (j != k) {
                    EXPECT_NE(std::find(cells.vertices[n].begin(), cells.vertices[n].end(), v[j]),
                              cells.vertices[n].end());
                }
            if (cells.is_infinite(static_cast<int>(c))) continue;
            const auto& f = Tetrahedra::kFacet[k];
            EXPECT_EQ(orientation(points[v[f[0]]], points[v[f[1]]], points[v[f[2]]], points[v[k]]),
                      -1);  // the cell is behind its facet
        }
        if (!cells.is_infinite(static_cast<int>(c))) {
            EXPECT_EQ(orientation(points[v[0]], points[v[1]], points[v[2]], points[v[3]]), 1);
        }
    }
}

TEST(Tetrahedralise, HasNoCellsWithoutVolumeAndToleratesDuplicates) {
    EXPECT_EQ(tetrahedralise({}).size(), 0u);
    EXPECT_EQ(tetrahedralise(random_points(3, 1)).size(), 0u);
    auto flat = random_points(50, 2);
    for (Vec3& p : flat) p.z() = 0.25;
    EXPECT_EQ(tetrahedralise(flat).size(), 0u);
    auto doubled = random_points(40, 5);
    const std::size_t cells = tetrahedralise(doubled).size();
    doubled.push_back(doubled[7]);
    EXPECT_EQ(tetrahedralise(doubled).size(), cells);
}

TEST(Tetrahedralise, FindsTheVerticesThatShareAnEdge) {
    const auto points = random_points(80, 6);
    const Tetrahedra cells = tetrahedralise(points);
    std::set<std::pair<int, int>> truth, found;
    for (const auto& cell : cells.vertices)
        for (const int a : cell)
            for (const int b : cell)
                if (a >= 0 && b >= 0 && a != b) truth.insert({a, b});
    const Adjacency adjacency = vertex_adjacency(cells, points.size());
    ASSERT_EQ(adjacency.size(), points.size());
    for (std::size_t i = 0; i < points.size(); ++i)
        for (const int j : adjacency.of(i)) found.insert({static_cast<int>(i), j});
    EXPECT_EQ(found, truth);
}

class UpdateStrategies : public testing::TestWithParam<UpdateStrategy> {};

INSTANTIATE_TEST_SUITE_P(All, UpdateStrategies,
                         testing::Values(UpdateStrategy::Rebuild, UpdateStrategy::Move, UpdateStrategy::Lazy,
                                         UpdateStrategy::Auto),
                         [](const auto& of) { return std::string(name_of(of.param)); });

TEST_P(UpdateStrategies, IsThatOfTheMovedPointsOnceSettled) {
    auto points = random_points(100, 7);
    const auto dt = make_tetrahedralisation(GetParam());
    dt->assign(points);
    EXPECT_EQ(cell_sets(dt->cells()), cell_sets(tetrahedralise(points)));
    const auto moved = random_points(100, 8);
    for (int i = 0; i < 100; i += 3) {
        points[i] = moved[i];
        dt->move(i, moved[i]);
    }
    points.push_back(Vec3(0.1, 0.2, 0.3));
    EXPECT_EQ(dt->insert(points.back(), 5), 100);
    dt->settle();
    EXPECT_EQ(cell_sets(dt->cells()), cell_sets(tetrahedralise(points)));
    dt->remove(42);
    std::vector<int> neighbours;
    for (int i = 0; i <= 100; ++i) {
        if (i == 42) continue;
        dt->neighbours(i, neighbours);
        EXPECT_EQ(std::count(neighbours.begin(), neighbours.end(), 42), 0);
    }
    dt->settle();
    for (const auto& cell : dt->cells().vertices) EXPECT_EQ(std::count(cell.begin(), cell.end(), 42), 0);
}

/// The cells as sets of points, so that it does not matter how vertices are numbered.
std::set<std::vector<std::array<double, 3>>> cell_places(const Tetrahedra& cells,
                                                         const std::vector<Vec3>& points) {
    std::set<std::vector<std::array<double, 3>>> result;
    for (const auto& cell : cells.vertices) {
        std::vector<std::array<double, 3>> places;
        for (const int v : cell)
            if (v >= 0) places.push_back({points[v].x(), points[v].y(), points[v].z()});
        if (places.empty()) continue;  // a slot without a cell
        std::sort(places.begin(), places.end());
        result.insert(places);
    }
    return result;
}

TEST_P(UpdateStrategies, EqualsAFreshBuildAfterAnyHistory) {
    std::mt19937 random(12);
    std::uniform_real_distribution<double> u(-1.0, 1.0);
    const auto anywhere = [&] { return Vec3(u(random), u(random), u(random)); };
    const auto dt = make_tetrahedralisation(GetParam());
    std::vector<Vec3> points = random_points(30, 13);
    std::vector<char> alive(points.size(), 1);
    dt->assign(points);
    std::vector<std::array<int, 4>> seen;
    for (int round = 0; round < 25; ++round) {
        for (int change = 0; change < 12; ++change) {
            const int v = static_cast<int>(random() % points.size());
            switch (random() % 3) {
                case 0:
                    points.push_back(anywhere());
                    alive.push_back(1);
                    ASSERT_EQ(dt->insert(points.back(), alive[v] ? v : -1),
                              static_cast<int>(points.size()) - 1);
                    break;
                case 1:
                    if (!alive[v]) break;
                    points[v] += 0.1 * anywhere();
                    dt->move(v, points[v]);
                    break;
                default:
                    if (!alive[v]) break;
                    alive[v] = 0;
                    dt->remove(v);
            }
        }
        dt->settle();
        std::vector<Vec3> left;
        for (std::size_t i = 0; i < points.size(); ++i)
            if (alive[i]) left.push_back(points[i]);
        ASSERT_EQ(cell_places(dt->cells(), points), cell_places(tetrahedralise(left), left))
            << "round " << round;
        // The slots are linked both ways, and only those said to have changed did.
        const Tetrahedra& cells = dt->cells();
        for (std::size_t c = 0; c < cells.size(); ++c)
            for (int k = 0; k < 4; ++k) {
                const int n = cells.neighbour(c, k);
                if (n == static_cast<int>(c)) continue;
                ASSERT_EQ(cells.neighbour(n, cells.mirror_index(static_cast<int>(c), k)),
                          static_cast<int>(c));
            }
        if (round % 5 == 4) {
            dt->compact();
            points = left;
            alive.assign(points.size(), 1);
            ASSERT_EQ(cell_places(cells, points), cell_places(tetrahedralise(left), left));
            seen = cells.vertices;  // renamed, all of them
        }
        seen.resize(cells.size(), {-9, -9, -9, -9});
        for (const int c : dt->take_changed()) seen[c] = cells.vertices[c];
        ASSERT_EQ(seen, cells.vertices);
        // Neighbours are those of the cells.
        const Adjacency adjacency = vertex_adjacency(dt->cells(), points.size());
        std::vector<int> neighbours;
        for (std::size_t i = 0; i < points.size(); ++i) {
            if (!alive[i]) continue;
            dt->neighbours(static_cast<int>(i), neighbours);
            std::sort(neighbours.begin(), neighbours.end());
            ASSERT_EQ(neighbours, std::vector<int>(adjacency.of(i).begin(), adjacency.of(i).end()));
        }
    }
}

TEST_P(UpdateStrategies, MayRunOutOfPointsAndStartAgain) {
    const auto dt = make_tetrahedralisation(GetParam());
    dt->assign({});
    EXPECT_EQ(dt->cells().size(), 0u);
    dt->assign(random_points(6, 14));
    EXPECT_GT(dt->cells().size(), 0u);
    for (int v = 0; v < 4; ++v) dt->remove(v);
    dt->settle();
    EXPECT_EQ(dt->cells().size(), 0u);
    std::vector<int> neighbours{1, 2, 3};
    dt->neighbours(5, neighbours);
    EXPECT_TRUE(neighbours.empty());
    for (const Vec3& p : random_points(4, 15)) dt->insert(p, -1);
    dt->settle();
    EXPECT_GT(dt->cells().size(), 0u);
    dt->assign(random_points(10, 16));  // numbers start anew
    EXPECT_EQ(dt->insert(Vec3::Zero(), -1), 10);
}

TEST_P(UpdateStrategies, StartsAnewOnceCleared) {
    const auto dt = make_tetrahedralisation(GetParam());
    dt->assign(random_points(40, 18));
    dt->move(3, {0.1, 0.2, 0.3});
    dt->remove(4);
    const std::size_t built = dt->profile().build.calls, relocated = dt->profile().relocated;
    dt->clear();
    EXPECT_EQ(dt->cells().size(), 0u);
    EXPECT_TRUE(dt->take_changed().empty());
    EXPECT_EQ(dt->profile().build.calls, built);  // what was done is not forgotten
    EXPECT_EQ(dt->profile().relocated, relocated);
    const auto points = random_points(30, 19);
    dt->assign(points);
    EXPECT_EQ(cell_sets(dt->cells()), cell_sets(tetrahedralise(points)));
    EXPECT_EQ(dt->take_changed().size(), dt->cells().size());
    EXPECT_EQ(dt->insert(Vec3::Zero(), -1), 30);
}

TEST_P(UpdateStrategies, ChangeNothingWhereVerticesStay) {
    auto points = random_points(50, 20);
    const auto dt = make_tetrahedralisation(GetParam());
    dt->assign(points);
    dt->take_changed();
    for (int v = 0; v < 50; ++v) dt->move(v, points[v]);
    dt->settle();
    EXPECT_TRUE(dt->take_changed().empty());
    EXPECT_EQ(dt->profile().build.calls, 1u);
    EXPECT_EQ(dt->profile().relocated, 0u);
}

TEST_P(UpdateStrategies, LeavesAVertexOnTheVeryPlaceOfAnotherOut) {
    auto points = random_points(20, 17);
    points.push_back(points[3]);
    const auto dt = make_tetrahedralisation(GetParam());
    dt->assign(points);
    const Adjacency adjacency = vertex_adjacency(dt->cells(), points.size());
    EXPECT_EQ(adjacency.of(3).size() == 0u, adjacency.of(20).size() != 0u);  // one of the two
    dt->move(20, {0.01, 0.02, 0.03});
    dt->settle();
    EXPECT_GT(vertex_adjacency(dt->cells(), points.size()).of(20).size(), 0u);
}

TEST(Predicates, TellTheDiametralBallByExactArithmetic) {
    // In whole numbers: with n = (q - p) x (r - p), the centre of the circle is p + C / (2 |n|^2), and v is
    // inside when |w|^2 |n|^2 < w . C for w = v - p.
    int inside = 0, on = 0;
    for (unsigned seed = 0; seed < 3000; ++seed) {
        const auto points = whole_points(4, 6, seed);
        const Whole p = to_whole(points[0]), a = to_whole(points[1]) - p, b = to_whole(points[2]) - p,
                    w = to_whole(points[3]) - p, n = a.cross(b);
        if (n.squaredNorm() == 0) continue;
        const Whole c = a.squaredNorm() * b.cross(n) + b.squaredNorm() * n.cross(a);
        const std::int64_t gap = w.dot(c) - w.squaredNorm() * n.squaredNorm();
        ASSERT_EQ(in_diametral_ball(points[0], points[1], points[2], points[3]), gap > 0);
        inside += gap > 0;
        on += gap == 0;
    }
    EXPECT_GT(inside, 100);
    EXPECT_GT(on, 10);
}

TEST(Predicates, KeepTheirSignUnderPermutations) {
    for (unsigned seed = 0; seed < 200; ++seed) {
        auto points = whole_points(4, 3, seed);
        points[3].z() = std::nextafter(points[3].z(), 10.0);
        const Vec3 &p = points[0], &q = points[1], &r = points[2], &s = points[3];
        const int sign = orientation(p, q, r, s);
        EXPECT_EQ(orientation(q, r, p, s), sign);
        EXPECT_EQ(orientation(q, p, r, s), -sign);
        EXPECT_EQ(orientation(p, q, s, r), -sign);
        EXPECT_EQ(orientation(s, r, q, p), sign);
        if (orientation(p, q, r, Vec3(1, 1, 1)) != 0 || sign != 0) {
            EXPECT_EQ(in_diametral_ball(p, q, r, s), in_diametral_ball(r, q, p, s));
        }
    }
}

TEST(Predicates, AreExactOnTheBoundary) {
    const Vec3 p(1, 0, 0), q(0, 1, 0), r(-1, 0, 0);  // great circle of the unit sphere
    EXPECT_FALSE(in_diametral_ball(p, q, r, Vec3(0, 0, 1)));
    EXPECT_TRUE(in_diametral_ball(p, q, r, Vec3(0, 0, std::nextafter(1.0, 0.0))));
    EXPECT_FALSE(in_diametral_ball(p, q, r, Vec3(0, 0, std::nextafter(1.0, 2.0))));
    EXPECT_EQ(orientation(p, q, r, Vec3(0.3, 0.4, 0.0)), 0);
    EXPECT_EQ(orientation(p, q, r, Vec3(0.3, 0.4, 1e-300)), 1);
}

}  // namespace
}  // namespace isotrack
