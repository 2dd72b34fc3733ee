// Triangles near a place, against looking at all of them.
#include "meshing/triangle_bins.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <random>

#include "support/meshes.h"

namespace isotrack {
namespace {

class InTriangleBins : public ::testing::TestWithParam<double> {
protected:
    /// A sphere of small triangles, and one as large as all.
    InTriangleBins() : mesh(support::icosphere(3)) {
        const int first = static_cast<int>(mesh.points.size());
        mesh.points.insert(mesh.points.end(), {Vec3(-3, -2, -1), Vec3(3, -1, 0), Vec3(0, 3, 2)});
        mesh.triangles.push_back({first, first + 1, first + 2});
    }
    Vec3 place() {
        std::uniform_real_distribution<double> uniform(-2.0, 2.0);
        return {uniform(random), uniform(random), uniform(random)};
    }

    TriangleMesh mesh;
    std::mt19937 random{3};
};

TEST_P(InTriangleBins, ThoseThatMeetABoxAreFound) {
    const TriangleBins bins(mesh.points, mesh.triangles, GetParam());
    std::uniform_real_distribution<double> size(0.0, 0.6);
    std::size_t found = 0;
    for (int round = 0; round < 200; ++round) {
        const Vec3 low = place();
        const Box box(low, low + Vec3(size(random), size(random), size(random)));
        const std::vector<int> expected = support::triangles_meeting(box, mesh);
        EXPECT_EQ(bins.meeting(box), expected);
        found += expected.size();
    }
    EXPECT_GT(found, 200u);
}

INSTANTIATE_TEST_SUITE_P(OfSize, InTriangleBins, ::testing::Values(1e-3, 0.1, 1.0, 100.0));

TEST(TriangleBins, AreTheSameAtAnyNumberOfThreads) {
    const TriangleMesh mesh = support::icosphere(6);  // of several blocks
    const Vec3 place(0.5, 0.6, 0.7);
    std::vector<std::vector<int>> meeting;
    for (const std::size_t threads : {1, 4}) {
        const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
        tbb::task_arena(static_cast<int>(threads)).execute([&] {
            const TriangleBins bins(mesh.points, mesh.triangles, 0.3);
            meeting.push_back(bins.meeting(Box(place - Vec3::Constant(0.8), place + Vec3::Constant(0.8))));
        });
    }
    EXPECT_GT(meeting[0].size(), 10000u);
    EXPECT_EQ(meeting[0], meeting[1]);
}

TEST(TriangleBins, MayBeEmpty) {
    const TriangleMesh none;
    const TriangleBins bins(none.points, none.triangles, 1.0);
    EXPECT_TRUE(bins.meeting(Box(Vec3(-1, -1, -1), Vec3(1, 1, 1))).empty());
}

}  // namespace
}  // namespace isotrack
