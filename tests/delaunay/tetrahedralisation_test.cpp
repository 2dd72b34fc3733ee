#include "isotrack/delaunay/tetrahedralisation.h"

#include <gtest/gtest.h>

#include <algorithm>
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

TEST(Tetrahedralise, OrientsCellsAndFacetsAndLinksNeighboursBothWays) {
    const auto points = random_points(200, 4);
    const Tetrahedra cells = tetrahedralise(points);
    for (std::size_t c = 0; c < cells.size(); ++c) {
        const auto& v = cells.vertices[c];
        for (int k = 0; k < 4; ++k) {
            const int n = cells.neighbours[c][k], m = cells.mirror_index(static_cast<int>(c), k);
            EXPECT_EQ(cells.neighbours[n][m], static_cast<int>(c));
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

TEST(Tetrahedralisation, IsThatOfTheMovedPointsOnceSettled) {
    auto points = random_points(100, 7);
    const auto dt = make_tetrahedralisation(UpdateStrategy::Rebuild);
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
