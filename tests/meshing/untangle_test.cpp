// Labels changed where a boundary is tangled.
#include "isotrack/meshing/untangle.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "isotrack/meshing/convection.h"
#include "isotrack/meshing/manifold.h"
#include "isotrack/surface/shapes.h"
#include "support/samples.h"

namespace isotrack {
namespace {

using support::Samples;

TEST(Untangle, LeavesFewerComplexEdgesAndPinchedVerticesAndNothingWhereThereWereNone) {
    // Two balls a tenth of the spacing apart: the labels join them at some places and not at others.
    std::size_t before = 0, after = 0;
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
        const auto surface = shapes::unite(
            {shapes::sphere({-1.01, 0, 0}, 1.0, 0.25), shapes::sphere({1.01, 0, 0}, 1.0, 0.25)});
        const Samples s(*surface, 0.4, seed);
        const auto& points = s.particles.position;
        CellLabels labels = guided_convection(s.cells, points, s.particles.normal, *surface);
        CarvedSurface carved = carve(s.cells, labels, points);
        const std::size_t count = carved.complex_edges.size() + carved.pinched.size();
        before += count;
        const CellLabels untouched = labels;
        if (!untangle(labels, s.cells, points, *surface, carved)) {
            EXPECT_EQ(labels, untouched);
        }
        carved = carve(s.cells, labels, points);
        if (count == 0) {
            EXPECT_EQ(labels, untouched);
        }
        EXPECT_LE(carved.complex_edges.size() + carved.pinched.size(), count);
        after += carved.complex_edges.size() + carved.pinched.size();
        const auto probe = surface->probe();
        for (std::size_t c = 0; c < labels.size(); ++c) {
            if (labels[c] == untouched[c]) continue;
            Vec3 centroid = Vec3::Zero();
            for (const int v : s.cells.vertices[c]) centroid += 0.25 * points[v];
            EXPECT_LE(std::abs(probe->value(centroid)), 0.5 * surface->resolution());
        }
    }
    EXPECT_GT(before, 5u);
    EXPECT_LT(after, before / 2);
}

}  // namespace
}  // namespace isotrack
