// The errors of a mesh, and what is missed between lattice crossings.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <set>
#include <utility>
#include <vector>

#include "isotrack/surface/level_set.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"
#include "meshing/triangle_distance.h"
#include "support/carved.h"
#include "surface/cell_points.h"
#include "surface/float_precision.h"
#include "tracking/between_crossings.h"
#include "tracking/facets.h"
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
    const CrossingGrid cells(
        Surface::CrossingSequence(CellPoints(*box, crossings, box->diagonals()).around(all)), kResolution);
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

/// A box and its mesh, which takes dents.
struct InspectorOfABox : ::testing::Test {
    const shapes::SurfacePtr box = shapes::box({0.01, 0.02, 0.03}, {1.0, 0.7, 0.45}, kResolution);
    const CrossingGrid crossings{*box};
    Carved carved{*box, 0.06};
    FrameMesh mesh = carved.mesh();

    void dent_at(std::size_t v) {
        Vec3& p = mesh.vertices[v];
        p = to_float_precision(p * (1.0 - 0.05 / p.norm()));
    }
};

/// A mesh around the box, nowhere so far off that it is looked at for that alone.
struct BetweenCrossingsOfABox : InspectorOfABox {
    static constexpr double kTolerance = 0.5 * kResolution, kOff = 0.7 * kTolerance;
    const Vec3 middle{0.01, 0.02, 0.03}, half{1.0, 0.7, 0.45};
    std::vector<Vec3> vertices;
    std::vector<Triangle> triangles;
    MeshDistances distances{crossings, 3.0 * kTolerance};

    void SetUp() override {
        for (int k = 0; k < 8; ++k)
            vertices.push_back(
                middle +
                ((half.array() - kOff) * (2.0 * Eigen::Array3d(k & 1, k >> 1 & 1, k >> 2) - 1.0)).matrix());
        for (int axis = 0; axis < 3; ++axis)
            for (const int side : {0, 1}) {
                const int a = side << axis, u = 1 << (axis + 1) % 3, v = 1 << (axis + 2) % 3;
                const int b = a + (side == 1 ? u : v), c = a + u + v, d = a + (side == 1 ? v : u);
                triangles.insert(triangles.end(), {{a, b, c}, {a, c, d}});
            }
        distances.measure(vertices, triangles, {});
        for (std::size_t c = 0; c < crossings.size(); ++c) ASSERT_NEAR(distances[c], kOff, 0.1 * kOff);
    }
    /// Of what is found at a mesh: all that is within a resolution of a place, and nothing that is farther
    /// than four.
    template <typename Distance>
    void expect_near(const Distance& from, const std::vector<Vec3>& at, const std::vector<Triangle>& of) {
        const PackedCrossings points =
            BetweenCrossings(*box, crossings, {}, kTolerance).points(at, of, distances);
        std::vector<int> all(crossings.size());
        std::iota(all.begin(), all.end(), 0);
        const PackedCrossings cells = CellPoints(*box, crossings, {}).around(all);
        const auto count = [&](const PackedCrossings& some, double distance) {
            std::size_t result = 0;
            for (std::size_t i = 0; i < some.size(); ++i) result += from(some.point(i)) < distance;
            return result;
        };
        EXPECT_GT(count(points, kResolution), 0u);
        EXPECT_EQ(count(points, kResolution), count(cells, kResolution));
        EXPECT_EQ(count(points, 4.0 * kResolution), points.size());
        EXPECT_LT(points.size(), cells.size());
    }
};

TEST_F(BetweenCrossingsOfABox, AreLookedAtAlongEdgesWhereBothEndsTurn) {
    const auto from_edges = [&](const Vec3& p) {
        double least = 1.0;
        for (const Triangle& t : triangles)
            for (int k = 0; k < 3; ++k)
                least = std::min(least, squared_distance(p, vertices[t[k]], vertices[t[(k + 1) % 3]]));
        return std::sqrt(least);
    };
    expect_near(from_edges, vertices, triangles);
}

TEST_F(BetweenCrossingsOfABox, AreLookedAtAroundATip) {
    // In the middle of a face; the sides are 35 degrees steep, so that what is around it turns by half that.
    constexpr double kRadius = 0.6, kDepth = 0.36;
    const Vec3 tip = middle + Vec3(0.0, 0.0, half.z());
    std::vector<Vec3> at{tip};
    std::vector<Triangle> sides;
    for (int k = 0; k < 6; ++k) {
        const double way = k * 3.14159265358979323846 / 3.0;
        at.emplace_back(tip + Vec3(kRadius * std::cos(way), kRadius * std::sin(way), -kDepth));
        sides.push_back({0, k + 1, (k + 1) % 6 + 1});
    }
    expect_near([&](const Vec3& p) { return (p - tip).norm(); }, at, sides);
}

TEST_F(InspectorOfABox, FindsTheSameBetweenCrossingsByWhatChanged) {
    const auto& triangles = mesh.carved.triangles;
    constexpr double kTolerance = 0.06, kCutoff = 3.0 * kTolerance;
    BetweenCrossings all(*box, crossings, {}, kTolerance), by_changes(*box, crossings, {}, kTolerance);
    const auto measured = [&](const std::vector<Vec3>& vertices) {
        MeshDistances distances(crossings, kCutoff);
        distances.measure(vertices, triangles, {});
        return distances;
    };
    MeshDistances kept = measured(mesh.vertices);
    const auto sorted = [](const PackedCrossings& points) {
        std::vector<std::array<double, 3>> result;
        for (std::size_t i = 0; i < points.size(); ++i) {
            const Vec3 p = points.point(i);
            result.push_back({p.x(), p.y(), p.z()});
        }
        std::sort(result.begin(), result.end());
        return result;
    };
    EXPECT_EQ(sorted(all.points(mesh.vertices, triangles, measured(mesh.vertices))),
              sorted(by_changes.points(mesh.vertices, triangles, measured(mesh.vertices))));
    std::size_t found = 0;
    const auto& vertices = mesh.vertices;
    for (std::size_t v = 5; v < vertices.size(); v += vertices.size() / 7) {  // one dent after the other
        const auto facets = [&] {
            std::vector<Facet> result;
            for (const Triangle& t : triangles)
                if (std::find(t.begin(), t.end(), static_cast<int>(v)) != t.end())
                    result.push_back({0,
                                      {vertices[t[0]].cast<float>(), vertices[t[1]].cast<float>(),
                                       vertices[t[2]].cast<float>()}});
            return result;
        };
        FacetChanges changes;
        changes.went = facets();
        dent_at(v);
        changes.came = facets();
        changes.around = triangles_near_gone(changes.went, 2.01 * kCutoff, vertices, triangles);
        BetweenCrossings::Changes changed;
        for (const Facet& facet : changes.came)
            changed.corners.insert(changed.corners.end(), facet.corner.begin(), facet.corner.end());
        changed.crossings = kept.measure(vertices, triangles, changes).value();
        const auto expected = sorted(all.points(vertices, triangles, measured(vertices)));
        EXPECT_EQ(sorted(by_changes.points_near(changed, vertices, triangles, kept)), expected);
        found += expected.size();
    }
    EXPECT_GT(found, 20u);
}

TEST_F(InspectorOfABox, KnowsWhatChangedSinceItLookedBetweenCrossings) {
    Inspector kept(*box, carved.limits, crossings), anew(*box, carved.limits, crossings);
    const auto look = [&](Inspector& inspector) {
        Inspection inspection = inspector.inspect_both_ways(mesh);
        inspector.look_between(mesh, inspection);
    };
    const auto found_by = [](const Inspector& inspector) {
        std::set<std::array<double, 3>> result;
        for (const CrossingGrid* points : inspector.reached())
            for (std::size_t i = 0; i < points->size(); ++i) {
                const Vec3 p = to_float_precision((*points)[i].point);
                result.insert({p.x(), p.y(), p.z()});
            }
        return result;
    };
    look(kept);
    look(anew);
    const std::size_t at_first = found_by(kept).size();
    EXPECT_EQ(found_by(kept), found_by(anew));
    const std::size_t apart = mesh.vertices.size() / 7;
    for (std::size_t v = 5; v + apart / 2 < mesh.vertices.size(); v += apart) {
        // Two dents at places of their own, the first of which is there at the second inspection, too.
        for (const std::size_t dent : {v, v + apart / 2}) {
            dent_at(dent);
            kept.inspect_both_ways(mesh);
        }
        look(kept);
        anew.restart();  // all is looked at then
        look(anew);
        EXPECT_EQ(found_by(kept), found_by(anew)) << v;
    }
    EXPECT_GT(found_by(kept).size(), at_first + 20);
}

TEST_F(InspectorOfABox, HasTheErrorsOfEachMesh) {
    for (Vec3& p : mesh.vertices) p = to_float_precision(p);
    Inspector kept(*box, carved.limits, crossings);
    const auto values = [](const Inspection& inspection) {
        std::vector<std::array<float, 6>> result;
        for (const FacetError& e : *inspection.errors)
            result.push_back({e.largest, e.mean_square, e.turned_deg, e.where.x(), e.where.y(), e.where.z()});
        return result;
    };
    const auto measured_anew = [&] {
        return values(Inspector(*box, carved.limits, crossings).inspect_both_ways(mesh));
    };
    Inspection held = kept.inspect_both_ways(mesh);  // as trials of other meshes do
    const auto at_first = values(held);
    EXPECT_EQ(at_first, measured_anew());
    for (std::size_t v = 3; v < mesh.vertices.size(); v += 11) dent_at(v);
    EXPECT_EQ(values(kept.inspect_both_ways(mesh)), measured_anew());
    EXPECT_EQ(values(held), at_first);
    // The last are held, too, and then by nobody.
    for (std::size_t v = 5; v < mesh.vertices.size(); v += 11) dent_at(v);
    held = kept.inspect_both_ways(mesh);
    const auto at_last = values(held);
    for (std::size_t v = 8; v < mesh.vertices.size(); v += 11) dent_at(v);
    EXPECT_EQ(values(kept.inspect_both_ways(mesh)), measured_anew());
    EXPECT_EQ(values(held), at_last);
    // Nobody holds those before. As many triangles, but most with another number: one less, then one more.
    for (std::size_t v = 7; v < mesh.vertices.size(); v += 11) dent_at(v);
    std::vector<char> left_out(mesh.carved.triangles.size(), 0);
    left_out[5] = 1;
    const FrameMesh whole = mesh;
    const auto& [i, j, k] = mesh.carved.triangles[5];
    const std::vector<Vec3> corners = {mesh.vertices[i], mesh.vertices[j], mesh.vertices[k]};
    mesh = without(std::move(mesh), left_out);
    const int first = static_cast<int>(mesh.vertices.size());
    append(mesh, corners, {{first, first + 1, first + 2}});
    EXPECT_EQ(values(kept.inspect_both_ways(mesh)), measured_anew());
    mesh = whole;
    EXPECT_EQ(values(kept.inspect_both_ways(mesh)), measured_anew());
}

TEST(Inspector, LetsAnyTriangleStandForWhatACrossingStandsFor) {
    constexpr double kTolerance = 0.1, kCutoff = 3.0 * kTolerance;
    const LevelSet level_set(
        rasterise(*shapes::box({0.01, 0.02, 0.03}, {1.0, 0.7, 0.45}, kResolution), kResolution));
    const CrossingGrid crossings(level_set, 2.0 * kResolution);
    ASSERT_TRUE(crossings.thinned_out(level_set));
    FrameMesh mesh = Carved(level_set, kTolerance).mesh();
    for (Vec3& v : mesh.vertices) v *= 0.9;  // which brings some too far off, and others nearly
    MeshDistances distances(crossings, kCutoff);
    distances.measure(mesh.vertices, mesh.carved.triangles, {});
    BetweenCrossings between(level_set, crossings, {}, kTolerance);
    const CrossingGrid points(
        Surface::CrossingSequence(between.points(mesh.vertices, mesh.carved.triangles, distances)),
        kResolution);
    ASSERT_GT(points.size(), 50u);
    const auto all = level_set.crossings();
    for (std::size_t i = 0; i < points.size(); ++i) {
        EXPECT_EQ(points[i].outward, Eigen::Vector3f::Zero());
        EXPECT_TRUE(std::any_of(all.begin(), all.end(), [&](const Surface::Crossing& crossing) {
            return (crossing.point - points[i].point).norm() < 1e-6;
        }));
    }
    std::vector<Triangle> turned = mesh.carved.triangles;
    for (Triangle& t : turned) std::swap(t[0], t[1]);
    const auto as_they_are = crossing_distances(mesh.vertices, mesh.carved.triangles, points, kCutoff),
               turned_over = crossing_distances(mesh.vertices, turned, points, kCutoff);
    for (std::size_t i = 0; i < points.size(); ++i) EXPECT_NEAR(as_they_are[i], turned_over[i], 1e-6);
}

}  // namespace
}  // namespace isotrack
