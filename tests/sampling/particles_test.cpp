// Particles that come, go and change places, and their neighbours.
#include "support/particles.h"

#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "isotrack/sampling/adjacency.h"

namespace isotrack {
namespace {

TEST(Particles, ComeAndGoAndChangePlacesWithAllThatBelongsToThem) {
    Particles particles;
    for (int i = 0; i < 5; ++i) {
        particles.add(Vec3(i, 0, 0), Vec3(0, i, 0), 0.1 * i, 10 + i, Vec3(0, 0, i));
        particles.stretch.back() = Vec3(i, i, 0);
    }
    particles.retain({1, 0, 1, 1, 1});
    particles.reorder({2, 0, 3, 1});
    ASSERT_EQ(particles.size(), 4u);
    const int expected[] = {3, 0, 4, 2};
    for (int k = 0; k < 4; ++k) {
        const int i = expected[k];
        EXPECT_EQ(particles.position[k], Vec3(i, 0, 0));
        EXPECT_EQ(particles.normal[k], Vec3(0, i, 0));
        EXPECT_EQ(particles.spacing[k], 0.1 * i);
        EXPECT_EQ(particles.stretch[k], Vec3(i, i, 0));
        EXPECT_EQ(particles.id[k], 10 + i);
        EXPECT_EQ(particles.velocity[k], Vec3(0, 0, i));
    }
}

TEST(Adjacency, RingOfClosedMeshesAndOfSuchAsAreTurned) {
    // An octahedron around the axis from 4 to 5; then with a triangle turned over, one missing, one twice.
    std::vector<std::array<int, 3>> triangles;
    for (int i = 0; i < 4; ++i) {
        triangles.push_back({i, (i + 1) % 4, 4});
        triangles.push_back({(i + 1) % 4, i, 5});
    }
    for (int change = 0; change < 4; ++change) {
        if (change == 1) std::swap(triangles[2][0], triangles[2][1]);
        if (change == 2) triangles.pop_back();
        if (change == 3) triangles.push_back(triangles.front());
        const Adjacency ring = ring_of(triangles, 7);
        for (int i = 0; i < 6; ++i) {
            const int opposite = i < 4 ? (i + 2) % 4 : 9 - i;
            std::vector<int> expected;
            for (int j = 0; j < 6; ++j)
                if (j != i && j != opposite) expected.push_back(j);
            EXPECT_EQ(std::vector<int>(ring.of(i).begin(), ring.of(i).end()), expected) << change;
        }
        EXPECT_EQ(ring.of(6).size(), 0u);
    }
}

TEST(Adjacency, RingSquareGapsAndNewborn) {
    // A strip 0 1 2 3 4 of triangles.
    const Adjacency ring = ring_of({{0, 1, 2}, {1, 3, 2}, {2, 3, 4}}, 6);
    const auto list = [](const Adjacency& a, std::size_t i) {
        return std::vector<int>(a.of(i).begin(), a.of(i).end());
    };
    ASSERT_EQ(ring.size(), 6u);
    EXPECT_EQ(list(ring, 0), (std::vector<int>{1, 2}));
    EXPECT_EQ(list(ring, 2), (std::vector<int>{0, 1, 3, 4}));
    EXPECT_TRUE(list(ring, 5).empty());
    EXPECT_EQ(list(ring.squared(), 0), (std::vector<int>{1, 2, 3, 4}));
    EXPECT_EQ(list(ring.squared(), 4), (std::vector<int>{0, 1, 2, 3}));
    const Adjacency of_one = ring.squared({0, 0, 0, 0, 1});
    EXPECT_EQ(list(of_one, 4), (std::vector<int>{0, 1, 2, 3}));
    EXPECT_EQ(of_one.of(0).size(), 0u);
    // Without 2 its neighbours 0 1 3 4 know each other; they are numbered 0 1 2 3 now.
    const Adjacency gap = ring.restricted({1, 1, 0, 1, 1, 1});
    ASSERT_EQ(gap.size(), 5u);
    EXPECT_EQ(list(gap, 0), (std::vector<int>{1, 2, 3}));
    EXPECT_EQ(list(gap, 2), (std::vector<int>{0, 1, 3}));
    const Adjacency more = ring.extended({{1, 2, 3}}, 8);
    ASSERT_EQ(more.size(), 8u);
    EXPECT_EQ(list(more, 6), (std::vector<int>{1, 2, 3}));
    EXPECT_EQ(list(more, 1), (std::vector<int>{0, 2, 3, 6}));
    EXPECT_TRUE(list(more, 7).empty());
}

}  // namespace
}  // namespace isotrack
