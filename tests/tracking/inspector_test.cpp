// What is missed between lattice crossings.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "isotrack/surface/shapes.h"
#include "support/carved.h"
#include "surface/cell_points.h"
#include "tracking/failing.h"
#include "tracking/inspection.h"

namespace isotrack {
namespace {

using support::Carved;
using support::kResolution;

TEST(Inspector, FindsWhatIsMissedBetweenCrossingsThatAreReached) {
    // Seeds are not on the edges, which the mesh cuts off.
    Eigen::Isometry3d turn = Eigen::Isometry3d::Identity();
    turn.rotate(Eigen::AngleAxisd(0.5, Vec3(1.0, 2.0, 3.0).normalized()));
    const auto box = shapes::moved(shapes::box({0, 0, 0}, {1.0, 0.7, 0.45}, kResolution), turn);
    const CrossingGrid crossings(*box);
    std::vector<int> all(crossings.size());
    std::iota(all.begin(), all.end(), 0);
    const CrossingGrid cells(CellPoints(crossings, box->lattice(), box->diagonals()).around(all),
                             kResolution);
    Carved carved(*box, 1.0);
    const FrameMesh mesh = carved.mesh();
    int found = 0;
    for (double tolerance = 0.02; tolerance < 0.1; tolerance += 0.001) {
        carved.limits.tolerance = tolerance;
        const double limit = kCertified * tolerance;
        const auto distances =
            crossing_distances(mesh.vertices, mesh.carved.triangles, cells, 3.0 * tolerance);
        Inspector inspector(*box, carved.limits, crossings);
        Inspection inspection = inspector.inspect_both_ways(mesh);
        const auto missed_near = [&](const Vec3& p, double distance) {
            return std::any_of(inspection.missed.begin(), inspection.missed.end(),
                               [&](const auto& c) { return (c.point - p).norm() <= distance; });
        };
        std::vector<Vec3> hidden;  // no crossing near it is missed
        for (std::size_t c = 0; c < cells.size(); ++c)
            if (distances[c] > limit && !missed_near(cells[c].point, kResolution))
                hidden.push_back(cells[c].point);
        inspector.look_between(mesh, inspection);
        for (const Vec3& p : hidden) EXPECT_TRUE(missed_near(p, 1e-5)) << p.transpose();
        found += static_cast<int>(hidden.size());
        for (const double d : crossing_distances(mesh.vertices, mesh.carved.triangles,
                                                 CrossingGrid(inspection.missed, kResolution), tolerance))
            EXPECT_GT(d, limit - 1e-6);
    }
    EXPECT_GT(found, 0);
}

}  // namespace
}  // namespace isotrack
