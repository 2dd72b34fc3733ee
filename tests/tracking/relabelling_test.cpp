// Cells that change sides, on meshes whose faults are known.
#include "tracking/relabelling.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "isotrack/surface/shapes.h"
#include "support/carved.h"

namespace isotrack {
namespace {

using support::Carved;
using support::kResolution;
using support::topology_of;

TEST(Relabelling, GivesACellOnTheWrongSideBack) {
    const auto solid = shapes::ellipsoid({0, 0, 0}, {1.0, 0.8, 0.6}, kResolution);
    const auto probe = solid->probe();
    Carved carved(*solid, 0.1);
    const CellLabels right = carved.labels;
    ASSERT_EQ(carved.relabel(), 0u);
    int dents = 0;
    for (int c = 0; c < static_cast<int>(right.size()); ++c) {
        // With one facet on the boundary its absence is a dent, whose floor is far inside.
        int outside = 0;
        for (int k = 0; k < 4 && right[c]; ++k) outside += !right[carved.cells.neighbour(c, k)];
        if (outside != 1 || probe->value(carved.centroid(c)) > -0.2) continue;
        carved.labels = right;
        carved.labels[c] = 0;
        EXPECT_GT(carved.relabel(), 0u);
        EXPECT_EQ(carved.labels, right) << "cell " << c;
        ++dents;
    }
    EXPECT_GT(dents, 3);
}

TEST(Relabelling, LeavesCellsThatAreClearlyOnTheirSide) {
    const auto torus = shapes::torus({0, 0, 0}, 1.0, 0.4, kResolution);
    const auto probe = torus->probe();
    Carved carved(*torus, 1e-5);  // which no triangle keeps
    const CellLabels before = carved.labels;
    EXPECT_GT(carved.relabel(), 0u);  // slivers on the surface, which lie on the side that they do not say
    for (int c = 0; c < static_cast<int>(before.size()); ++c) {
        if (carved.labels[c] == before[c]) continue;
        const double value = probe->value(carved.centroid(c));
        EXPECT_LE(before[c] ? -value : value, 0.2 * carved.limits.tolerance);
    }
}

/// Takes away, one after the other, all cells with this label that a particle has, so that no triangle is at
/// it any more, says that it is missed, and reaches out for it.
void take_away_and_reach_out(const Surface& surface, char label) {
    const double tolerance = 0.1;
    Carved carved(surface, tolerance);
    const CellLabels right = carved.labels;
    int reached = 0;
    for (int p = 0; p < static_cast<int>(carved.particles.size()); ++p) {
        carved.labels = right;
        bool at_hull = false;
        for (int c = 0; c < static_cast<int>(right.size()); ++c) {
            const auto& v = carved.cells.vertices[c];
            if (right[c] != label || std::find(v.begin(), v.end(), p) == v.end()) continue;
            at_hull = at_hull || carved.cells.is_infinite(c);
            carved.labels[c] = static_cast<char>(!label);
        }
        if (at_hull) continue;
        const FrameMesh before = carved.mesh();
        const auto uses = [p](const FrameMesh& mesh) {
            return std::count(mesh.carved.particle.begin(), mesh.carved.particle.end(), p) > 0;
        };
        ASSERT_FALSE(uses(before));
        Inspection inspection = carved.inspect(before);
        const auto reach = [&](const SizingLimits& limits) {
            return reach_out(carved.labels, carved.cells, before, inspection, carved.particles, surface,
                             limits);
        };
        EXPECT_EQ(reach(carved.limits), 0u);  // nobody says that it is missed
        inspection.missed.push_back({carved.particles.position[p], carved.particles.normal[p].cast<float>()});
        SizingLimits tight = carved.limits;
        tight.tolerance = 1e-4;
        EXPECT_EQ(reach(tight), 0u);
        if (reach(carved.limits) == 0) continue;  // all its cells are too far from the surface
        const FrameMesh after = carved.mesh();
        EXPECT_TRUE(uses(after));
        EXPECT_TRUE(topology_of(after).closed() && topology_of(after).manifold());
        EXPECT_EQ(topology_of(after).euler, topology_of(before).euler);
        const Inspection inspection_after = carved.inspect(after);
        for (const FacetError& e : *inspection_after.errors) EXPECT_LE(e.largest, tolerance);
        ++reached;
    }
    EXPECT_GT(reached, 10);
}

TEST(ReachingOut, BringsBackATipThatWasCutOff) {
    take_away_and_reach_out(*shapes::plate({0, 0, 0}, 1.0, 0.15, kResolution), 1);
}

TEST(ReachingOut, BringsBackADentThatWasFilled) {
    take_away_and_reach_out(*shapes::unite({shapes::plate({0, 0, -0.125}, 1.0, 0.15, kResolution),
                                            shapes::plate({0, 0, 0.125}, 1.0, 0.15, kResolution)}),
                            0);
}

}  // namespace
}  // namespace isotrack
