// Triangles near a place, against looking at all of them.
#include "meshing/triangle_boxes.h"

#include <gtest/gtest.h>

#include <random>

#include "support/meshes.h"

namespace isotrack {
namespace {

TEST(TriangleBoxes, FindWhatMeetsABoxAsTheMeshChanges) {
    TriangleMesh mesh = support::icosphere(3);
    TriangleBoxes boxes(mesh.points, mesh.triangles);
    std::mt19937 random(3);
    std::uniform_real_distribution<double> place(-1.2, 1.2), size(0.0, 0.4);
    std::uniform_int_distribution<int> any(0, static_cast<int>(mesh.points.size()) - 1);
    std::size_t found = 0;
    for (int round = 0; round < 200; ++round) {
        const int moved = any(random);
        mesh.points[moved] += 0.3 * Vec3(place(random), place(random), place(random));
        for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
            for (const int v : mesh.triangles[t])
                if (v == moved) boxes.note(static_cast<int>(t));
        const Vec3 low(place(random), place(random), place(random));
        const Box box(low, low + Vec3(size(random), size(random), size(random)));
        const std::vector<int> expected = support::triangles_meeting(box, mesh);
        EXPECT_EQ(boxes.meeting(box), expected);
        found += expected.size();
    }
    EXPECT_GT(found, 200u);
}

}  // namespace
}  // namespace isotrack
