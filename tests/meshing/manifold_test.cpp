// What is carved from labels: closed, oriented, manifold.
#include "isotrack/meshing/manifold.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"
#include "isotrack/surface/shapes.h"
#include "support/samples.h"

namespace isotrack {
namespace {

using support::mesh_of;
using support::Samples;

double volume_of_cell(const Tetrahedra& cells, const std::vector<Vec3>& points, std::size_t c) {
    const auto& v = cells.vertices[c];
    return (points[v[1]] - points[v[0]]).cross(points[v[2]] - points[v[0]]).dot(points[v[3]] - points[v[0]]) /
           6.0;
}

std::vector<Vec3> random_points(std::size_t count, std::mt19937& random, bool on_lattice) {
    std::uniform_real_distribution<double> real(0.0, 1.0);
    std::uniform_int_distribution<int> whole(0, 4);
    std::vector<Vec3> points;
    for (std::size_t i = 0; i < count; ++i)
        points.push_back(on_lattice ? Vec3(whole(random), whole(random), whole(random))
                                    : Vec3(real(random), real(random), real(random)));
    return points;
}

/// What carve says of complex edges and of its particles, counted on the cells themselves. Empty when right.
std::string wrong_count(const Tetrahedra& cells, const CellLabels& labels, const CarvedSurface& carved) {
    std::map<std::pair<int, int>, int> facets_at_edge;
    std::set<int> on_boundary;
    for (std::size_t c = 0; c < cells.size(); ++c)
        for (int k = 0; k < 4; ++k) {
            if (!labels[c] || labels[cells.neighbour(c, k)]) continue;
            int v[3];
            for (int i = 0; i < 3; ++i) v[i] = cells.vertices[c][Tetrahedra::kFacet[k][i]];
            for (int i = 0; i < 3; ++i) {
                on_boundary.insert(v[i]);
                ++facets_at_edge[std::minmax(v[i], v[(i + 1) % 3])];
            }
        }
    std::set<std::pair<int, int>> complex, said;
    for (const auto& [edge, count] : facets_at_edge)
        if (count > 2) complex.insert(edge);
    const auto holds = [&](int cell, int particle) {
        const auto& v = cells.vertices[cell];
        return labels[cell] && std::count(v.begin(), v.end(), particle) == 1;
    };
    for (const auto& e : carved.complex_edges) {
        said.insert(std::minmax(e.from, e.to));
        if (!holds(e.cell, e.from) || !holds(e.cell, e.to)) return "a complex edge's cell";
    }
    if (said != complex || carved.complex_edges.size() != complex.size()) return "complex edges";
    std::map<int, int> copies;
    for (const int p : carved.particle)
        if (p >= 0) ++copies[p];
    std::set<int> used;
    for (const auto& entry : copies) used.insert(entry.first);
    if (used != on_boundary) return "particles";
    std::vector<int> pinched;
    for (const auto& [p, count] : copies)
        if (count > 1) pinched.push_back(p);
    std::vector<int> said_pinched;
    for (const auto& v : carved.pinched) {
        said_pinched.push_back(v.particle);
        if (!holds(v.cell, v.particle)) return "a pinched particle's cell";
    }
    if (said_pinched != pinched) return "pinched particles";
    return "";
}

// The promise of carve holds for any labels whatever.
TEST(Carve, IsClosedOrientedAndManifoldForRandomLabels) {
    std::mt19937 random(7);
    std::size_t complex = 0, pinched = 0, split = 0;
    for (int round = 0; round < 400; ++round) {
        const auto points = random_points(5 + round % 60, random, round % 4 == 3);
        const Tetrahedra cells = tetrahedralise(points);
        std::bernoulli_distribution inside(0.1 + 0.8 * (round % 7) / 6.0);
        CellLabels labels(cells.size(), 0);
        double volume = 0.0;
        for (std::size_t c = 0; c < cells.size(); ++c)
            if (!cells.is_infinite(static_cast<int>(c)) && inside(random)) {
                labels[c] = 1;
                volume += volume_of_cell(cells, points, c);
            }
        const CarvedSurface carved = carve(cells, labels, points);
        const TriangleMesh mesh = mesh_of(carved, points);
        const MeshTopology t = mesh_topology(mesh);
        ASSERT_TRUE(t.closed() && t.oriented() && t.manifold()) << "round " << round;
        ASSERT_EQ(t.unused_vertices, 0u) << "round " << round;
        ASSERT_NEAR(enclosed_volume(mesh), volume, 1e-9 * (1.0 + volume)) << "round " << round;
        ASSERT_EQ(wrong_count(cells, labels, carved), "") << "round " << round;
        complex += carved.complex_edges.size();
        pinched += carved.pinched.size();
        split += carved.midpoints.size();
    }
    // The cases that the promise is about did come up.
    EXPECT_GT(complex, 1000u);
    EXPECT_GT(pinched, 1000u);
    EXPECT_GT(split, 10u);
}

TEST(Carve, CutsNothingOpenThatOnlyTouches) {
    std::mt19937 random(11);
    for (int round = 0; round < 20; ++round) {
        const auto points = random_points(60, random, false);
        const Tetrahedra cells = tetrahedralise(points);
        std::bernoulli_distribution inside(0.4);
        CellLabels labels(cells.size(), 0);
        for (std::size_t c = 0; c < cells.size(); ++c)
            labels[c] = !cells.is_infinite(static_cast<int>(c)) && inside(random);
        const auto carved = carve(cells, labels, points);
        // Triangles given twice, or crossing, would be pairs; midpoints lie on the edges of others and so may
        // touch them.
        if (carved.midpoints.empty()) {
            EXPECT_EQ(self_intersections(mesh_of(carved, points)).size(), 0u) << "round " << round;
        }
    }
}

TEST(Carve, SaysWhichCellIsBehindEachTriangle) {
    const auto surface = shapes::torus({0, 0, 0}, 1.0, 0.3, 0.05);
    const Samples s(*surface, 0.12);
    const auto labels = guided_convection(s.cells, s.particles.position, s.particles.normal, *surface);
    const auto carved = carve(s.cells, labels, s.particles.position);
    ASSERT_EQ(carved.facet.size(), carved.triangles.size());
    ASSERT_TRUE(carved.midpoints.empty());
    for (std::size_t t = 0; t < carved.triangles.size(); ++t) {
        const int c = carved.inside_cell(t), k = carved.inside_facet(t);
        EXPECT_EQ(labels[c], 1);
        EXPECT_EQ(labels[s.cells.neighbour(c, k)], 0);
        std::set<int> facet, expected;
        for (int v = 0; v < 3; ++v) {
            facet.insert(carved.particle[carved.triangles[t][v]]);
            expected.insert(s.cells.vertices[c][Tetrahedra::kFacet[k][v]]);
        }
        EXPECT_EQ(facet, expected);
    }
    // Particles in their order, each once.
    const std::size_t own = carved.particle.size() - carved.pinched.size();
    EXPECT_TRUE(std::is_sorted(carved.particle.begin(), carved.particle.begin() + own));
}

TEST(Carve, GivesTwoVerticesToSolidsThatTouchInOne) {
    // Two octahedra-like halves of cells that share a vertex only: found by labelling two cells of a random
    // DT.
    std::mt19937 random(3);
    const auto points = random_points(40, random, false);
    const Tetrahedra cells = tetrahedralise(points);
    const auto common = [&](std::size_t a, std::size_t b) {
        int count = 0;
        for (const int v : cells.vertices[a])
            for (const int w : cells.vertices[b]) count += v == w;
        return count;
    };
    int seen[3] = {0, 0, 0};
    for (std::size_t a = 0; a < cells.size(); ++a)
        for (std::size_t b = a + 1; b < cells.size(); ++b) {
            if (cells.is_infinite(static_cast<int>(a)) || cells.is_infinite(static_cast<int>(b))) continue;
            const int shared = common(a, b);
            if (shared > 2 || seen[shared] > 20) continue;
            ++seen[shared];
            CellLabels labels(cells.size(), 0);
            labels[a] = labels[b] = 1;
            const auto carved = carve(cells, labels, points);
            const MeshTopology t = mesh_topology(mesh_of(carved, points));
            ASSERT_EQ(t.components, 2u) << shared;
            ASSERT_EQ(t.euler, 4) << shared;
            ASSERT_EQ(carved.pinched.size(), static_cast<std::size_t>(shared));
            ASSERT_EQ(carved.complex_edges.size(), shared == 2 ? 1u : 0u);
        }
    EXPECT_GT(seen[1], 0);
    EXPECT_GT(seen[2], 0);
}

TEST(Carve, GivesNothingForNothing) {
    std::mt19937 random(5);
    const auto points = random_points(30, random, false);
    const Tetrahedra cells = tetrahedralise(points);
    EXPECT_TRUE(carve(cells, CellLabels(cells.size(), 0), points).triangles.empty());
    EXPECT_TRUE(carve({}, {}, {}).triangles.empty());
    EXPECT_TRUE(guided_convection({}, {}, {}, *shapes::sphere({0, 0, 0}, 1.0, 0.1)).empty());
    EXPECT_TRUE(pure_convection({}, {}).empty());
}

}  // namespace
}  // namespace isotrack
