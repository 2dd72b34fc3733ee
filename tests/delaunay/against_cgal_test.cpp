// The DT beside that of another library.
#include <CGAL/Delaunay_triangulation_3.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Triangulation_vertex_base_with_info_3.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "isotrack/delaunay/predicates.h"
#include "isotrack/delaunay/tetrahedralisation.h"
#include "support/gaussian_points.h"

namespace isotrack {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using VertexBase = CGAL::Triangulation_vertex_base_with_info_3<int, Kernel>;
using CellBase = CGAL::Delaunay_triangulation_cell_base_3<Kernel>;
using Cgals =
    CGAL::Delaunay_triangulation_3<Kernel, CGAL::Triangulation_data_structure_3<VertexBase, CellBase>>;
using Cells = std::set<std::array<int, 4>>;

Cells cells_of_cgal(const std::vector<Vec3>& points) {
    std::vector<std::pair<Kernel::Point_3, int>> numbered;
    for (std::size_t i = 0; i < points.size(); ++i)
        numbered.emplace_back(Kernel::Point_3(points[i].x(), points[i].y(), points[i].z()),
                              static_cast<int>(i));
    const Cgals dt(numbered.begin(), numbered.end());
    Cells result;
    for (auto c = dt.all_cells_begin(); c != dt.all_cells_end(); ++c) {
        std::array<int, 4> cell;
        for (int k = 0; k < 4; ++k)
            cell[k] = dt.is_infinite(c->vertex(k)) ? Tetrahedra::kInfinite : c->vertex(k)->info();
        std::sort(cell.begin(), cell.end());
        result.insert(cell);
    }
    return result;
}

Cells sorted_cells(const Tetrahedra& cells) {
    Cells result;
    for (auto cell : cells.vertices) {
        std::sort(cell.begin(), cell.end());
        result.insert(cell);
    }
    EXPECT_EQ(result.size(), cells.size());
    return result;
}

/// Points in general position and in all the positions that are not.
std::vector<std::pair<std::string, std::vector<Vec3>>> clouds() {
    std::vector<std::pair<std::string, std::vector<Vec3>>> result;
    const auto ball = support::gaussian_points(2000, 1);
    result.emplace_back("ball", ball);
    auto points = ball;
    for (Vec3& p : points) p.normalize();
    result.emplace_back("sphere", points);
    for (Vec3& p : points) p = p.cast<float>().cast<double>();
    result.emplace_back("sphere of floats", points);
    for (Vec3& p : points) p = p.normalized() * (1.0 + 0.2 * std::sin(5.0 * p.x()) * std::sin(6.0 * p.y()));
    result.emplace_back("bumps", points);
    for (const Vec3& far : {Vec3(9, 1, 2), Vec3(-7, 3, 1), Vec3(0, 20, 1), Vec3(1, -3, 8)})
        points.push_back(far);
    result.emplace_back("bumps from afar", points);
    points.clear();
    for (int i = 0; i < 9 * 9 * 9; ++i) points.emplace_back(i / 81, i / 9 % 9, i % 9);
    result.emplace_back("lattice", points);
    for (std::size_t i = 0; i < points.size(); i += 5) points[i] += Vec3(1e-16, -1e-15, 1e-17);
    result.emplace_back("lattice with rounding errors", points);
    points = ball;
    for (Vec3& p : points) p.z() *= 1e-12;
    result.emplace_back("sheet", points);
    for (Vec3& p : points) p.z() = p.x() > 0.0 ? 1.0 : 0.0;
    result.emplace_back("two planes", points);
    points = ball;
    for (Vec3& p : points) p = Vec3(0.0, 0.0, p.z()) + 1e-9 * p;
    result.emplace_back("line", points);
    points = ball;
    for (Vec3& p : points) p += Vec3(1e7, -1e7, 1e6);
    result.emplace_back("far away", points);
    points.resize(300);
    for (const double size : {1e-70, 1e-30, 1e30}) {
        for (int i = 0; i < 300; ++i) points[i] = size * ball[i].normalized();
        result.emplace_back("of size " + std::to_string(std::log10(size)), points);
    }
    return result;
}

TEST(Tetrahedralise, HasTheCellsThatCgalsHas) {
    for (const auto& [name, points] : clouds())
        EXPECT_TRUE(sorted_cells(tetrahedralise(points)) == cells_of_cgal(points)) << name;
}

TEST(Tetrahedralisation, FollowsPointsOfALatticeToTheCellsThatCgalsHas) {
    // A lattice that loses and regains a tenth of its points, others of which go half a step and back.
    std::vector<Vec3> points;
    for (int i = 0; i < 6 * 6 * 6; ++i) points.emplace_back(i / 36, i / 6 % 6, i % 6);
    for (const auto strategy : {UpdateStrategy::Move, UpdateStrategy::Lazy, UpdateStrategy::Auto}) {
        const auto dt = make_tetrahedralisation(strategy);
        dt->assign(points);
        auto moved = points;
        for (std::size_t i = 0; i < points.size(); i += 10) {
            moved[i] += Vec3(0.5, 0.5, 0.0);
            dt->move(static_cast<int>(i), moved[i]);
        }
        dt->settle();
        const auto places = [](const Cells& cells, const std::vector<Vec3>& of) {
            std::set<std::vector<std::array<double, 3>>> result;
            for (const auto& cell : cells) {
                std::vector<std::array<double, 3>> corners;
                for (const int v : cell)
                    if (v >= 0) corners.push_back({of[v].x(), of[v].y(), of[v].z()});
                std::sort(corners.begin(), corners.end());
                if (!corners.empty()) result.insert(corners);
            }
            return result;
        };
        const auto used = [&] {
            Cells cells;
            for (auto cell : dt->cells().vertices) {
                std::sort(cell.begin(), cell.end());
                if (cell[3] >= 0) cells.insert(cell);
            }
            return cells;
        };
        EXPECT_EQ(used(), cells_of_cgal(moved)) << name_of(strategy);
        std::vector<Vec3> left;
        for (std::size_t i = 0; i < points.size(); ++i) {
            if (i % 10 == 3)
                dt->remove(static_cast<int>(i));
            else
                left.push_back(moved[i]);
        }
        dt->settle();
        EXPECT_EQ(places(used(), moved), places(cells_of_cgal(left), left)) << name_of(strategy);
        for (std::size_t i = 0; i < points.size(); i += 10) dt->move(static_cast<int>(i), points[i]);
        for (std::size_t i = 3; i < points.size(); i += 10) {
            moved.push_back(points[i]);
            dt->insert(points[i], -1);
        }
        dt->settle();
        for (std::size_t i = 0; i < points.size(); i += 10) moved[i] = points[i];
        EXPECT_EQ(places(used(), moved), places(cells_of_cgal(points), points)) << name_of(strategy);
    }
}

TEST(Predicates, DecideOnTheSphereAlikeForAllItsCells) {
    // Points with whole coordinates on the sphere of radius 9.
    std::vector<Vec3> sphere;
    for (int x = -9; x <= 9; ++x)
        for (int y = -9; y <= 9; ++y)
            for (int z = -9; z <= 9; ++z)
                if (x * x + y * y + z * z == 81) sphere.emplace_back(x, y, z);
    ASSERT_GT(sphere.size(), 50u);
    std::mt19937 random(5);
    int inside = 0, outside = 0;
    for (int trial = 0; trial < 4000; ++trial) {
        std::array<Vec3, 5> p;
        for (Vec3& q : p) q = sphere[random() % sphere.size()];
        bool distinct = true;
        for (int i = 0; i < 5; ++i)
            for (int j = 0; j < i; ++j) distinct = distinct && p[i] != p[j];
        if (!distinct || orientation(p[0], p[1], p[2], p[3]) <= 0) continue;
        const bool in = in_sphere(p[0], p[1], p[2], p[3], p[4]);
        ++(in ? inside : outside);
        EXPECT_EQ(in_sphere(p[1], p[2], p[0], p[3], p[4]), in);
        EXPECT_EQ(in_sphere(p[3], p[2], p[1], p[0], p[4]), in);
        // From across a facet the answer is the same.
        if (orientation(p[0], p[1], p[2], p[4]) < 0) {
            EXPECT_EQ(in_sphere(p[0], p[2], p[1], p[4], p[3]), in);
        }
    }
    EXPECT_GT(inside, 200);
    EXPECT_GT(outside, 200);
    // Off the sphere by the smallest step there is nothing to decide.
    const Vec3 p(1, 0, 0), q(0, 1, 0), r(0, 0, 1), s(-1, 0, 0);
    const int sign = orientation(p, q, r, s);
    const auto holds = [&](const Vec3& v) {
        return sign > 0 ? in_sphere(p, q, r, s, v) : in_sphere(q, p, r, s, v);
    };
    EXPECT_TRUE(holds(Vec3(0, std::nextafter(-1.0, 0.0), 0)));
    EXPECT_FALSE(holds(Vec3(0, std::nextafter(-1.0, -2.0), 0)));
    EXPECT_TRUE(collinear(Vec3(0, 0, 0), Vec3(1, 2, 3), Vec3(-2, -4, -6)));
    EXPECT_FALSE(collinear(Vec3(0, 0, 0), Vec3(1, 2, 3), Vec3(-2, -4, std::nextafter(-6.0, 0.0))));
}

}  // namespace
}  // namespace isotrack
