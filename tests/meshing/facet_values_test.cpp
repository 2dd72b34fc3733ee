// The surface's values on one facet.
#include "meshing/facet_values.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <set>

#include "isotrack/surface/shapes.h"
#include "meshing/sharpness.h"
#include "support/meshes.h"

namespace isotrack {
namespace {

constexpr double kFloat = 6e-8;  // rounding to float, relative; the values themselves are exact to 1e-14

TEST(FacetValues, AreThoseOfTheSurfaceAtItsPlaces) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    const auto probe = sphere->probe();
    const Vec3 a(1, 0, 0), b(0.8, 0.5, 0), c(0.8, 0.1, 0.6);
    const FacetValues facet(a, b, c, *probe);
    const Vec3 area = (b - a).cross(c - a);
    EXPECT_NEAR(facet.area2, area.norm(), kFloat * area.norm());
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(facet.normal[k], area.normalized()[k], kFloat);
    double squares = 0.0;
    for (int n = 0; n < FacetValues::kPoints; ++n) {
        const auto& [u, v, w] = FacetValues::kPlace[n];
        EXPECT_NEAR(u + v + w, 1.0, 1e-15);
        const double distance = (u * a + v * b + w * c).norm() - 1.0;
        EXPECT_NEAR(facet.value[n], distance, kFloat * std::abs(distance) + 1e-14);
        squares += distance * distance;
    }
    const double error = area.norm() * squares / FacetValues::kPoints;
    EXPECT_NEAR(facet.error(), error, 3.0 * kFloat * error);
}

TEST(FacetValues, AreAtTheCornersTwiceOnEachEdgeAndInTheMiddle) {
    std::set<std::array<int, 3>> places;
    int zeros[3] = {};
    for (const auto& place : FacetValues::kPlace) {
        std::array<int, 3> thirds{};
        for (int k = 0; k < 3; ++k) {
            thirds[k] = static_cast<int>(std::lround(3.0 * place[k]));
            EXPECT_NEAR(3.0 * place[k], thirds[k], 1e-15);
        }
        places.insert(thirds);
        ++zeros[std::count(thirds.begin(), thirds.end(), 0)];
    }
    EXPECT_EQ(places.size(), 10u);
    EXPECT_EQ(zeros[0], 1);
    EXPECT_EQ(zeros[1], 6);
    EXPECT_EQ(zeros[2], 3);
}

TEST(FacetValues, OfAFacetWithoutAreaCountNothing) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    const FacetValues facet({2, 0, 0}, {3, 0, 0}, {4, 0, 0}, *sphere->probe());
    EXPECT_TRUE(facet.normal.isZero(0.0f));
    EXPECT_EQ(facet.error(), 0.0);
}

TEST(FacetValues, OfAMeshAreThoseOfEachAlone) {
    const auto ellipsoid = shapes::ellipsoid({0.1, 0.2, 0.3}, {1.0, 0.8, 0.6}, 0.1);
    TriangleMesh mesh = support::icosphere(2);
    std::mt19937 random(3);
    for (Triangle& t : mesh.triangles) std::rotate(t.begin(), t.begin() + random() % 3, t.end());
    std::shuffle(mesh.triangles.begin(), mesh.triangles.end(), random);
    mesh.triangles.resize(mesh.triangles.size() - 20);  // some edges have one side
    mesh.triangles.push_back(mesh.triangles.front());   // some have three
    const auto facets =
        facet_values(mesh.points, mesh.triangles, Corners(mesh.points.size(), mesh.triangles), *ellipsoid);
    ASSERT_EQ(facets.size(), mesh.triangles.size());
    const auto probe = ellipsoid->probe();
    for (std::size_t t = 0; t < facets.size(); ++t) {
        const auto& [i, j, k] = mesh.triangles[t];
        const FacetValues alone(mesh.points[i], mesh.points[j], mesh.points[k], *probe);
        for (int n = 0; n < FacetValues::kPoints; ++n)
            EXPECT_NEAR(facets[t].value[n], alone.value[n], 2.0 * kFloat * std::abs(alone.value[n]) + 1e-14);
        EXPECT_EQ(facets[t].normal, alone.normal);
        EXPECT_EQ(facets[t].area2, alone.area2);
    }
}

TEST(Sharpness, IsAskedForAsItIsCalculated) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> coordinate(-1.0, 1.0);
    const auto point = [&] { return Vec3(coordinate(random), coordinate(random), coordinate(random)); };
    int sharper = 0;
    for (int i = 0; i < 1000; ++i) {
        const Vec3 a = point(), b = point(), c = point();
        const bool is = sharpness(a, b, c) > kSharpnessAt30Degrees;
        EXPECT_EQ(is_sharper(kSharpnessAt30Degrees, a, b, c), is);
        sharper += is;
    }
    EXPECT_GT(sharper, 100);
    EXPECT_LT(sharper, 900);
    EXPECT_FALSE(is_sharper(kSharpnessAt30Degrees, {0, 0, 0}, {1, 0, 0}, {0.5, 0.8, 0}));
    EXPECT_TRUE(is_sharper(kSharpnessAt30Degrees, {0, 0, 0}, {1, 0, 0}, {2, 0, 0}));
}

}  // namespace
}  // namespace isotrack
