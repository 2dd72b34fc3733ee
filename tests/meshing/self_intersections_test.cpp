#include "isotrack/meshing/self_intersections.h"

#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/intersections.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <limits>
#include <random>

#include "isotrack/error.h"
#include "support/meshes.h"

namespace isotrack {
namespace {

using Pairs = std::vector<std::pair<int, int>>;

/// All pairs, by constructing the intersection exactly and asking whether it is more than the common vertices
/// span.
Pairs intersections_by_construction(const TriangleMesh& mesh) {
    using Kernel = CGAL::Exact_predicates_exact_constructions_kernel;
    using Point = Kernel::Point_3;
    const auto point = [&](int v) {
        return Point(mesh.points[v].x(), mesh.points[v].y(), mesh.points[v].z());
    };
    const auto triangle = [&](const Triangle& t) {
        return Kernel::Triangle_3(point(t[0]), point(t[1]), point(t[2]));
    };
    Pairs result;
    const int n = static_cast<int>(mesh.triangles.size());
    for (int i = 0; i < n; ++i)
        for (int j = i + 1; j < n; ++j) {
            const auto a = triangle(mesh.triangles[i]), b = triangle(mesh.triangles[j]);
            if (a.is_degenerate() || b.is_degenerate()) continue;
            const auto shared = CGAL::intersection(a, b);
            if (!shared) continue;
            std::vector<Point> common;
            for (int k = 0; k < 3; ++k)
                for (int l = 0; l < 3; ++l)
                    if (a[k] == b[l]) common.push_back(a[k]);
            const auto allowed = [&](const Point& p) {
                if (common.size() == 1) return p == common[0];
                return common.size() == 2 && Kernel::Segment_3(common[0], common[1]).has_on(p);
            };
            bool harmless = false;
            if (const Point* p = boost::get<Point>(&*shared))
                harmless = allowed(*p);
            else if (const Kernel::Segment_3* s = boost::get<Kernel::Segment_3>(&*shared))
                harmless = allowed(s->source()) && allowed(s->target());
            if (!harmless) result.emplace_back(i, j);
        }
    return result;
}

TriangleMesh two_triangles(const std::vector<Vec3>& points, const Triangle& a, const Triangle& b) {
    TriangleMesh mesh;
    mesh.points = points;
    mesh.triangles = {a, b};
    return mesh;
}

const Pairs kNone, kBoth{{0, 1}};

TEST(SelfIntersections, FindsNoneInEmbeddedMeshes) {
    EXPECT_EQ(self_intersections({}), kNone);
    EXPECT_EQ(self_intersections(support::tetrahedron()), kNone);
    EXPECT_EQ(self_intersections(support::icosphere(4)), kNone);
    EXPECT_EQ(self_intersections(support::torus(150, 61)), kNone);  // by several threads
}

TEST(SelfIntersections, TreatsTrianglesWithoutCommonVertices) {
    const std::vector<Vec3> base{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}};
    const auto against = [&](const Vec3& a, const Vec3& b, const Vec3& c) {
        return self_intersections(two_triangles({base[0], base[1], base[2], a, b, c}, {0, 1, 2}, {3, 4, 5}));
    };
    EXPECT_EQ(against({1, 1, -1}, {1, 1, 1}, {2, 1, 1}), kBoth);
    EXPECT_EQ(against({1, 1, 0}, {1, 1, 1}, {2, 1, 1}), kBoth);    // a corner on the face
    EXPECT_EQ(against({2, 0, 0}, {2, -1, 1}, {3, -1, 1}), kBoth);  // a corner on the edge
    EXPECT_EQ(against({1, 1, 1e-300}, {1, 1, 1}, {2, 1, 1}), kNone);
    EXPECT_EQ(against({1, 1, 0}, {2, 1, 0}, {1, 2, 0}), kBoth);  // in one plane, inside
    EXPECT_EQ(against({4, 4, 0}, {5, 4, 0}, {4, 5, 0}), kNone);  // in one plane, apart
    EXPECT_EQ(against({1, 1, 1}, {2, 1, 1}, {1, 2, 1}), kNone);
}

TEST(SelfIntersections, TreatsTrianglesWithACommonVertexByIndexAndByPlace) {
    const auto against = [&](const Vec3& a, const Vec3& b) {
        const std::vector<Vec3> points{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, a, b, {-0.0, 0, 0}};
        const Pairs by_index = self_intersections(two_triangles(points, {0, 1, 2}, {3, 0, 4}));
        EXPECT_EQ(self_intersections(two_triangles(points, {0, 1, 2}, {4, 3, 5})), by_index);
        EXPECT_EQ(self_intersections(two_triangles(points, {2, 0, 1}, {5, 4, 3})), by_index);
        return by_index;
    };
    EXPECT_EQ(against({-1, 0, 0}, {0, -1, 0}), kNone);     // in one plane, opposite
    EXPECT_EQ(against({1, 1, 1}, {2, 1, 1}), kNone);       // above
    EXPECT_EQ(against({3, 1, 1}, {3, 1, -1}), kBoth);      // through the face
    EXPECT_EQ(against({-1, -1, 1}, {-1, -1, -1}), kNone);  // through the plane behind the vertex
    EXPECT_EQ(against({1, 1, 0}, {2, 1, 1}), kBoth);       // an edge in the face
    EXPECT_EQ(against({2, 0, 0}, {2, -1, 1}), kBoth);      // an edge on an edge
    EXPECT_EQ(against({4, 1, 0}, {1, 4, 0}), kBoth);       // in one plane, over each other
}

TEST(SelfIntersections, TreatsTrianglesWithACommonEdgeByIndexAndByPlace) {
    const auto against = [&](const Vec3& tip) {
        const std::vector<Vec3> points{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, tip, {0, 0, 0}, {4, 0, 0}};
        const Pairs by_index = self_intersections(two_triangles(points, {0, 1, 2}, {1, 0, 3}));
        EXPECT_EQ(self_intersections(two_triangles(points, {0, 1, 2}, {5, 4, 3})), by_index);
        EXPECT_EQ(self_intersections(two_triangles(points, {1, 2, 0}, {3, 1, 4})), by_index);
        return by_index;
    };
    EXPECT_EQ(against({1, -1, 0}), kNone);
    EXPECT_EQ(against({1, 1, 1e-300}), kNone);
    EXPECT_EQ(against({1, 1, 0}), kBoth);  // folded over
    EXPECT_EQ(against({1, 9, 0}), kBoth);
    EXPECT_EQ(against({0, 4, 0}), kBoth);  // the same triangle under other indices
}

TEST(SelfIntersections, LeavesOutTrianglesWithoutArea) {
    EXPECT_EQ(self_intersections(two_triangles(
                  {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}, {1, 1, -1}, {1, 1, 1}, {1, 1, 2}}, {0, 1, 2}, {3, 4, 5})),
              kNone);
    EXPECT_EQ(self_intersections(two_triangles({{0, 0, 0}, {4, 0, 0}, {0, 4, 0}}, {0, 1, 2}, {1, 1, 1})),
              kNone);
}

TEST(SelfIntersections, RefusesBrokenMeshes) {
    TriangleMesh mesh = support::tetrahedron();
    mesh.triangles[2][1] = 7;
    EXPECT_THROW(self_intersections(mesh), InputError);
    mesh = support::tetrahedron();
    mesh.points[1].y() = std::numeric_limits<double>::quiet_NaN();
    EXPECT_THROW(self_intersections(mesh), InputError);
}

// Few distinct coordinates: nearly every pair has common vertices, lies in one plane or touches.
TEST(SelfIntersections, AgreesWithConstructedIntersectionsOnLatticeSoups) {
    std::mt19937 random(3);
    for (int round = 0; round < 40; ++round) {
        TriangleMesh soup;
        const int side = 2 + round % 3;
        for (int i = 0; i < 30; ++i)
            soup.points.emplace_back(static_cast<int>(random() % side), static_cast<int>(random() % side),
                                     static_cast<int>(random() % side));
        for (int i = 0; i < 40; ++i)
            soup.triangles.push_back({static_cast<int>(random() % 30), static_cast<int>(random() % 30),
                                      static_cast<int>(random() % 30)});
        const Pairs pairs = intersections_by_construction(soup);
        EXPECT_EQ(self_intersections(soup), pairs);
        // Far from the origin, where floats cannot tell the coordinates apart.
        for (Vec3& p : soup.points) p = Vec3(0x1p20, -0x3p19, 0x1p21) + 0x1p-8 * p;
        EXPECT_EQ(self_intersections(soup), pairs);
    }
}

TEST(SomeAndOthers, ArePairsOfTheSameSoup) {
    std::mt19937 random(7);
    int with = 0, without = 0, crossed = 0;
    for (int round = 0; round < 400; ++round) {
        TriangleMesh soup;
        for (int i = 0; i < 12; ++i)
            soup.points.emplace_back(static_cast<int>(random() % 5), static_cast<int>(random() % 5),
                                     static_cast<int>(random() % 5));
        for (int i = 0; i < 6; ++i)
            soup.triangles.push_back({static_cast<int>(random() % 12), static_cast<int>(random() % 12),
                                      static_cast<int>(random() % 12)});
        constexpr int kSome = 2;
        const std::vector<Triangle> some(soup.triangles.begin(), soup.triangles.begin() + kSome),
            others(soup.triangles.begin() + kSome, soup.triangles.end());
        const Pairs pairs = intersections_by_construction(soup);
        const bool expected =
            std::any_of(pairs.begin(), pairs.end(), [](const auto& pair) { return pair.first < kSome; });
        EXPECT_EQ(any_cross(soup.points, some, others), expected);
        ++(expected ? with : without);

        std::vector<char> flags(others.size(), 0);
        for (const auto& [first, second] : pairs)
            if (first < kSome && second >= kSome) flags[second - kSome] = 1;
        EXPECT_EQ(crossed_by(soup.points, some, others), flags);
        EXPECT_EQ(crossed_by(soup.points, {}, others), std::vector<char>(others.size(), 0));
        crossed += static_cast<int>(std::count(flags.begin(), flags.end(), 1));
    }
    EXPECT_GT(with, 50);
    EXPECT_GT(without, 50);
    EXPECT_GT(crossed, 50);
}

// What is crossed among many: those that all pairs of both name.
TEST(SomeAndOthers, AreCrossedAsAllPairsSay) {
    std::mt19937 random(11);
    std::uniform_real_distribution<double> anywhere(0.0, 1.0), near(-0.1, 0.1);
    std::vector<Vec3> points;
    std::vector<Triangle> triangles;
    for (int t = 0; t < 1200; ++t) {
        const Vec3 middle(anywhere(random), anywhere(random), anywhere(random));
        for (int k = 0; k < 3; ++k) points.push_back(middle + Vec3(near(random), near(random), near(random)));
        triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
    }
    constexpr int kSome = 200;
    const std::vector<Triangle> some(triangles.begin(), triangles.begin() + kSome),
        others(triangles.begin() + kSome, triangles.end());
    std::vector<char> flags(others.size(), 0);
    for (const auto& [first, second] : self_intersections(points, triangles))
        if (first < kSome && second >= kSome) flags[second - kSome] = 1;
    const auto count = std::count(flags.begin(), flags.end(), 1);
    EXPECT_GT(count, 100);
    EXPECT_LT(count, 1000);
    EXPECT_EQ(crossed_by(points, some, others), flags);
}

// The cheap test that sets neighbours round a vertex apart must never be wrong, however thin the wedges.
TEST(SelfIntersections, AgreesWithConstructedIntersectionsRoundAVertex) {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> wide(-1.0, 1.0);
    for (int round = 0; round < 40; ++round) {
        const double thin = std::pow(10.0, -(round % 17));
        TriangleMesh soup;
        soup.points = {{0.1, 0.2, 0.3}};
        for (int i = 0; i < 30; ++i)
            soup.points.push_back(soup.points[0] +
                                  Vec3(wide(random), thin * wide(random), thin * wide(random)));
        for (int i = 0; i + 1 < 30; ++i) soup.triangles.push_back({0, i + 1, i + 2});
        EXPECT_EQ(self_intersections(soup), intersections_by_construction(soup));
    }
}

TEST(SelfIntersections, AgreesWithConstructedIntersectionsOnCrossingSurfaces) {
    const TriangleMesh mesh = support::join(support::icosphere(2), support::torus(16, 9, 0.9, 0.3));
    const Pairs pairs = self_intersections(mesh);
    EXPECT_GT(pairs.size(), 100u);
    EXPECT_EQ(pairs, intersections_by_construction(mesh));
    // So many that several threads find them.
    const TriangleMesh larger = support::join(support::icosphere(3), support::torus(36, 18, 0.9, 0.3));
    EXPECT_GT(larger.triangles.size(), 2048u);
    EXPECT_EQ(self_intersections(larger), intersections_by_construction(larger));
}

TEST(SelfIntersections, FindsTheSamePairsAtAnyThreadCountAndThoseOfLongTriangles) {
    const TriangleMesh a = support::torus(120, 60), b = support::icosphere(4, Vec3(0.9, 0.3, 0.1), 0.7);
    const Pairs pairs = self_intersections(support::join(a, b));
    EXPECT_GT(pairs.size(), 300u);
    EXPECT_TRUE(std::is_sorted(pairs.begin(), pairs.end()));
    for (const auto& [i, j] : pairs) {
        EXPECT_LT(i, static_cast<int>(a.triangles.size()));
        EXPECT_GE(j, static_cast<int>(a.triangles.size()));
    }
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    EXPECT_EQ(self_intersections(support::join(a, b)), pairs);
    // One is added through everything.
    TriangleMesh pierced = support::join(a, b);
    const int n = static_cast<int>(pierced.points.size());
    pierced.points.insert(pierced.points.end(), {{-3, 0.01, 0.02}, {3, 0.02, 0.03}, {3, 0.1, 0.2}});
    pierced.triangles.push_back({n, n + 1, n + 2});
    std::size_t expected = 0;
    for (std::size_t i = 0; i + 1 < pierced.triangles.size(); ++i) {
        TriangleMesh pair = pierced;
        pair.triangles = {pierced.triangles[i], pierced.triangles.back()};
        pair.points.resize(n + 3);
        if (i % 7 == 0) expected += !intersections_by_construction(pair).empty();
    }
    std::size_t found = 0;
    for (const auto& [i, j] : self_intersections(pierced))
        found += j + 1 == static_cast<int>(pierced.triangles.size()) && i % 7 == 0;
    EXPECT_GT(found, 0u);
    EXPECT_EQ(found, expected);
}

}  // namespace
}  // namespace isotrack
