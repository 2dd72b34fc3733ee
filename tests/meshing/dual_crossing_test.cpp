// Where a particle mends a facet.
#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "isotrack/meshing/certify.h"
#include "isotrack/meshing/convection.h"
#include "isotrack/surface/shapes.h"
#include "support/samples.h"

namespace isotrack {
namespace {

using support::Samples;

/// The boundary facets of labelled cells as (cell, facet).
std::vector<std::pair<int, int>> boundary_facets(const Tetrahedra& cells, const CellLabels& labels) {
    std::vector<std::pair<int, int>> facets;
    for (std::size_t c = 0; c < cells.size(); ++c)
        for (int k = 0; labels[c] && k < 4; ++k)
            if (!labels[cells.neighbour(c, k)]) facets.emplace_back(c, k);
    return facets;
}

TEST(DualCrossing, IsOnTheSurfaceAndNearestToTheFacetsOwnCorners) {
    for (const auto& surface :
         {shapes::sphere({0, 0, 0}, 1.0, 0.05), shapes::torus({0, 0, 0}, 1.0, 0.4, 0.05)}) {
        const Samples s(*surface, 0.2);
        const auto& points = s.particles.position;
        const auto labels = guided_convection(s.cells, points, s.particles.normal, *surface);
        const auto probe = surface->probe();
        const auto facets = boundary_facets(s.cells, labels);
        ASSERT_GT(facets.size(), 100u);
        for (const auto& [cell, k] : facets) {
            const auto x = dual_crossing(s.cells, points, cell, k, *probe);
            ASSERT_TRUE(x);
            EXPECT_NEAR(probe->value(*x), 0.0, 1e-4);
            double own[3], least = 1e300;
            for (int i = 0; i < 3; ++i)
                own[i] = (points[s.cells.vertices[cell][Tetrahedra::kFacet[k][i]]] - *x).norm();
            for (const Vec3& p : points) least = std::min(least, (p - *x).norm());
            EXPECT_NEAR(own[0], own[1], 1e-9);
            EXPECT_NEAR(own[0], own[2], 1e-9);
            EXPECT_NEAR(own[0], least, 1e-9);
        }
    }
}

}  // namespace
}  // namespace isotrack
