// What refitting takes back.
#include "tracking/refitted.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"
#include "isotrack/surface/shapes.h"
#include "support/carved.h"
#include "tracking/failing.h"
#include "tracking/inspection.h"

namespace isotrack {
namespace {

using support::Carved;
using support::kResolution;

double sharpest_cotangent(const std::vector<Vec3>& points, const Triangle& t) {
    double result = 0.0;
    for (int k = 0; k < 3; ++k) {
        const Vec3 u = points[t[(k + 1) % 3]] - points[t[k]], w = points[t[(k + 2) % 3]] - points[t[k]];
        result = std::max(result, u.dot(w) / u.cross(w).norm());
    }
    return result;
}

/// A box, whose edges no seed is on: flips and moves do much there.
struct RefitOfABox : ::testing::TestWithParam<double> {
    const shapes::SurfacePtr box = shapes::box({0, 0, 0}, {1.0, 0.7, 0.45}, kResolution);
};

TEST_P(RefitOfABox, TakesBackWhatItMustNot) {
    Carved carved(*box, GetParam());
    FrameMesh mesh = carved.mesh();
    const FrameMesh before = mesh;
    ASSERT_TRUE(self_intersections({mesh.vertices, mesh.carved.triangles, {}, {}}).empty());
    const CrossingGrid crossings(*box);
    Inspector inspector(*box, carved.limits, crossings);
    const Inspection first = inspector.inspect_both_ways(mesh);
    const Inspection last = refit_within(mesh, first, std::vector<char>(mesh.vertices.size(), 1), *box,
                                         carved.limits.tolerance, inspector);
    EXPECT_NE(mesh.vertices, before.vertices);

    const TriangleMesh after{mesh.vertices, mesh.carved.triangles, {}, {}};
    const MeshTopology topology = mesh_topology(after);
    EXPECT_TRUE(topology.closed() && topology.oriented() && topology.manifold());
    EXPECT_EQ(topology.euler, 2);
    EXPECT_TRUE(self_intersections(after).empty());
    double largest_before = 0.0, sum_before = 0.0, sum = 0.0;
    const auto area = [](const std::vector<Vec3>& p, const Triangle& t) {
        return (p[t[1]] - p[t[0]]).cross(p[t[2]] - p[t[0]]).norm();
    };
    for (std::size_t t = 0; t < first.errors->size(); ++t) {
        largest_before = std::max(largest_before, (*first.errors)[t].largest);
        sum_before += (*first.errors)[t].mean_square * area(before.vertices, before.carved.triangles[t]);
    }
    double sharpest_before = 0.0;
    for (const Triangle& t : before.carved.triangles)
        sharpest_before = std::max(sharpest_before, sharpest_cotangent(before.vertices, t));
    const auto errors = triangle_errors(after.points, after.triangles, *box, 6);
    for (std::size_t t = 0; t < errors.size(); ++t) {
        EXPECT_LE(errors[t].largest, 1.02 * std::max(GetParam(), largest_before));
        EXPECT_LE(sharpest_cotangent(after.points, after.triangles[t]),
                  std::max(std::sqrt(3.0), sharpest_before) + 1e-9);
        sum += errors[t].mean_square * area(after.points, after.triangles[t]);
    }
    EXPECT_LT(sum, 0.8 * sum_before);
    // Some may not have been looked at before.
    for (const double d : crossing_distances(before.vertices, before.carved.triangles,
                                             CrossingGrid(last.missed, kResolution), GetParam()))
        EXPECT_GT(d, kCertified * GetParam() - 1e-6);
}

INSTANTIATE_TEST_SUITE_P(Tolerances, RefitOfABox, ::testing::Values(0.02, 0.05, 0.2));

}  // namespace
}  // namespace isotrack
