#include "tracking/mesh_trials.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "isotrack/surface/level_set.h"
#include "support/carved.h"
#include "support/lattice_grid.h"
#include "tracking/frame_mesh.h"

namespace isotrack {
namespace {

using support::Carved;
using support::Inspected;

/// Three for each triangle.
std::vector<Vec3> corners_of(const FrameMesh& mesh) {
    std::vector<Vec3> result;
    for (const Triangle& t : mesh.carved.triangles)
        for (const int v : t) result.push_back(mesh.vertices[v]);
    return result;
}

TEST(MeshTrials, TakeNoMeshThatIsFartherOffOrMissesMore) {
    // A ball and a drop.
    const LevelSet surface(support::lattice_grid({-12, -9, -9}, {12, 9, 9}, [](const Vec3& p) {
        const double ball = (p - Vec3(0.1, 0.2, 0.3)).norm() - 5.3,
                     drop = (p - Vec3(8.1, 0.4, 0.6)).norm() - 1.3;
        return std::min(ball, drop);
    }));
    const Carved carved(surface, 0.5, 0.8);
    FrameMesh mesh = carved.mesh();
    const FrameMesh before = mesh;
    Inspected now(carved, mesh);
    const auto farthest = std::max_element(mesh.vertices.begin(), mesh.vertices.end(),
                                           [](const Vec3& a, const Vec3& b) { return a.y() < b.y(); }) -
                          mesh.vertices.begin();
    for (const double dent : {0.9, -0.9}) {
        FrameMesh other = before;
        other.vertices[farthest].y() -= dent;
        EXPECT_FALSE(now.trials.may_have(corners_of(other)));
        const std::vector<Vec3> refused = other.vertices;
        EXPECT_FALSE(now.trials.try_mesh(std::move(other)));
        EXPECT_EQ(other.vertices, refused);
    }
    EXPECT_TRUE(now.trials.may_have(corners_of(before)));
    // Without the drop: no triangle is farther off.
    std::vector<char> of_drop;
    for (const Triangle& t : before.carved.triangles) of_drop.push_back(before.vertices[t[0]].x() > 6.3);
    EXPECT_FALSE(now.trials.try_mesh(without(before, of_drop)));
    EXPECT_EQ(mesh.vertices, before.vertices);
    EXPECT_EQ(now.inspection.errors->size(), before.carved.triangles.size());
    EXPECT_TRUE(now.inspection.missed.empty());

    FrameMesh nearer = before;
    std::swap(nearer.carved.triangles.front(), nearer.carved.triangles.back());
    EXPECT_TRUE(now.trials.try_mesh(FrameMesh(nearer)));
    EXPECT_FALSE(now.trials.try_to_mend(FrameMesh(before)));  // nothing fails
    EXPECT_EQ(mesh.carved.triangles, nearer.carved.triangles);
}

}  // namespace
}  // namespace isotrack
