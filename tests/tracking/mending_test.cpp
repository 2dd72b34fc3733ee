// What mends a frame's mesh or makes it better, on meshes whose faults are known.
#include <gtest/gtest.h>
#include <openvdb/openvdb.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <vector>

#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"
#include "isotrack/sampling/cover.h"
#include "isotrack/surface/level_set.h"
#include "isotrack/surface/shapes.h"
#include "support/meshes.h"
#include "surface/cell_points.h"
#include "surface/float_precision.h"
#include "tracking/failing.h"
#include "tracking/inspection.h"
#include "tracking/lost_drops.h"
#include "tracking/patches.h"
#include "tracking/refitted.h"
#include "tracking/relabelling.h"
#include "tracking/specks.h"

namespace isotrack {
namespace {

constexpr double kResolution = 0.05, kEdge = 0.2;

/// Seeds on a surface, their DT, and the mesh carved from it.
struct Carved {
    const Surface& surface;
    SizingLimits limits{};
    Particles particles;
    Tetrahedra cells;
    CellLabels labels;

    Carved(const Surface& of, double tolerance, double edge = kEdge) : surface(of) {
        limits.tolerance = 0.1 * edge;  // for the seeds
        limits.angle = 0.7;
        limits.min_edge = limits.max_edge = edge;
        limits.detail = surface.resolution();
        Id next_id = 0;
        cover(particles, surface, CrossingGrid(surface), limits, 1, next_id);
        limits.tolerance = tolerance;
        cells = tetrahedralise(particles.position);
        labels = guided_convection(cells, particles.position, particles.normal, surface);
    }
    FrameMesh mesh() const {
        FrameMesh result;
        result.carved = carve(cells, labels, particles.position);
        std::size_t midpoint = 0;
        for (const int p : result.carved.particle)
            result.vertices.push_back(p >= 0 ? particles.position[p] : result.carved.midpoints[midpoint++]);
        result.on_surface = result.vertices;
        return result;
    }
    Carve carve_labels() {
        return [this](CellLabels& of_cells) {
            labels = of_cells;
            return mesh();
        };
    }
    Inspection inspect(const FrameMesh& mesh) const {
        Inspection result;
        result.errors = std::make_shared<const std::vector<TriangleError>>(
            triangle_errors(mesh.vertices, mesh.carved.triangles, surface, 6));
        return result;
    }
    Vec3 centroid(int cell) const {
        Vec3 sum = Vec3::Zero();
        for (const int v : cells.vertices[cell]) sum += particles.position[v];
        return sum / 4.0;
    }
    std::size_t relabel() {
        const FrameMesh now = mesh();
        return isotrack::relabel(labels, cells, now, inspect(now), particles, surface, limits);
    }
};

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
    const auto topology = [](const FrameMesh& mesh) {
        return mesh_topology({mesh.vertices, mesh.carved.triangles, {}, {}});
    };
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
        EXPECT_TRUE(topology(after).closed() && topology(after).manifold());
        EXPECT_EQ(topology(after).euler, topology(before).euler);
        for (const TriangleError& e : *carved.inspect(after).errors) EXPECT_LE(e.largest, tolerance);
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

double sharpest_cotangent(const std::vector<Vec3>& points, const Triangle& t) {
    double result = 0.0;
    for (int k = 0; k < 3; ++k) {
        const Vec3 u = points[t[(k + 1) % 3]] - points[t[k]], w = points[t[(k + 2) % 3]] - points[t[k]];
        result = std::max(result, u.dot(w) / u.cross(w).norm());
    }
    return result;
}

/// A box, whose edges no seed is on: flips and moves do much there.
struct RefitOfABox : ::testing::TestWithParam<double> {
    const shapes::SurfacePtr box = shapes::box({0, 0, 0}, {1.0, 0.7, 0.45}, kResolution);
};

TEST_P(RefitOfABox, TakesBackWhatItMustNot) {
    Carved carved(*box, GetParam());
    FrameMesh mesh = carved.mesh();
    const FrameMesh before = mesh;
    ASSERT_TRUE(self_intersections({mesh.vertices, mesh.carved.triangles, {}, {}}).empty());
    const CrossingGrid crossings(*box);
    Inspector inspector(*box, carved.limits, crossings);
    const Inspection first = inspector.inspect_both_ways(mesh);
    const Inspection last = refit_within(mesh, first, std::vector<char>(mesh.vertices.size(), 1), *box,
                                         carved.limits.tolerance, inspector);
    EXPECT_NE(mesh.vertices, before.vertices);

    const TriangleMesh after{mesh.vertices, mesh.carved.triangles, {}, {}};
    const MeshTopology topology = mesh_topology(after);
    EXPECT_TRUE(topology.closed() && topology.oriented() && topology.manifold());
    EXPECT_EQ(topology.euler, 2);
    EXPECT_TRUE(self_intersections(after).empty());
    double largest_before = 0.0, sum_before = 0.0, sum = 0.0;
    const auto area = [](const std::vector<Vec3>& p, const Triangle& t) {
        return (p[t[1]] - p[t[0]]).cross(p[t[2]] - p[t[0]]).norm();
    };
    for (std::size_t t = 0; t < first.errors->size(); ++t) {
        largest_before = std::max(largest_before, (*first.errors)[t].largest);
        sum_before += (*first.errors)[t].mean_square * area(before.vertices, before.carved.triangles[t]);
    }
    double sharpest_before = 0.0;
    for (const Triangle& t : before.carved.triangles)
        sharpest_before = std::max(sharpest_before, sharpest_cotangent(before.vertices, t));
    const auto errors = triangle_errors(after.points, after.triangles, *box, 6);
    for (std::size_t t = 0; t < errors.size(); ++t) {
        EXPECT_LE(errors[t].largest, 1.02 * std::max(GetParam(), largest_before));
        EXPECT_LE(sharpest_cotangent(after.points, after.triangles[t]),
                  std::max(std::sqrt(3.0), sharpest_before) + 1e-9);
        sum += errors[t].mean_square * area(after.points, after.triangles[t]);
    }
    EXPECT_LT(sum, 0.8 * sum_before);
    // Some may not have been looked at before.
    for (const double d : crossing_distances(before.vertices, before.carved.triangles,
                                             CrossingGrid(last.missed, kResolution), GetParam()))
        EXPECT_GT(d, kCertified * GetParam() - 1e-6);
}

INSTANTIATE_TEST_SUITE_P(Tolerances, RefitOfABox, ::testing::Values(0.02, 0.05, 0.2));

/// A mesh, its inspection with all that there is to look at, and trials of others.
struct Inspected {
    CrossingGrid crossings;
    Inspector inspector;
    Inspection inspection;
    MeshTrials trials;

    Inspected(const Carved& carved, FrameMesh& mesh) : Inspected(carved.surface, carved.limits, mesh) {}
    Inspected(const Surface& surface, const SizingLimits& limits, FrameMesh& mesh)
        : crossings(surface),
          inspector(surface, limits, crossings),
          inspection(inspector.inspect_both_ways(mesh)),
          trials(mesh, inspection, inspector, limits) {
        inspector.look_between(mesh, inspection);
        inspector.inspect_topology(mesh, inspection);
    }
};

/// Three for each triangle.
std::vector<Vec3> corners_of(const FrameMesh& mesh) {
    std::vector<Vec3> result;
    for (const Triangle& t : mesh.carved.triangles)
        for (const int v : t) result.push_back(mesh.vertices[v]);
    return result;
}

/// A disk of one layer of lattice nodes, which are inside by little: about a third of a voxel thick. Beside
/// it a ball, so that the values inside are known for distances.
openvdb::FloatGrid::Ptr thin_disk_and_ball() {
    auto grid = openvdb::FloatGrid::create(3.0f);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    auto values = grid->getAccessor();
    for (int x = -13; x <= 26; ++x)
        for (int y = -13; y <= 13; ++y)
            for (int z = -9; z <= 9; ++z) {
                const double disk = std::max(std::abs(z) - 0.15, std::hypot(x + 0.1, y - 0.2) - 8.3);
                const double ball = (Vec3(x, y, z) - Vec3(18.2, 0.1, 0.3)).norm() - 5.3;
                values.setValue({x, y, z}, static_cast<float>(std::clamp(std::min(disk, ball), -3.0, 3.0)));
            }
    return grid;
}

void expect_sound(const FrameMesh& mesh) {
    const MeshTopology topology = topology_of(mesh);
    EXPECT_TRUE(topology.closed() && topology.oriented() && topology.manifold());
    EXPECT_TRUE(self_intersections({mesh.vertices, mesh.carved.triangles, {}, {}}).empty());
}

/// Takes cells near a place out of a surface's mesh, which gets that other Euler number, then patches it.
void expect_patched(const openvdb::FloatGrid::Ptr& grid, const Vec3& place, double radius, long without) {
    const LevelSet surface(grid);
    const auto euler = surface.lattice_euler();
    const auto components = surface.lattice_components();
    ASSERT_TRUE(euler && components);
    Carved carved(surface, 0.5, 0.8);
    ASSERT_EQ(topology_of(carved.mesh()).euler, *euler);
    for (int c = 0; c < static_cast<int>(carved.labels.size()); ++c)
        if (carved.labels[c] && (carved.centroid(c) - place).norm() < radius) carved.labels[c] = 0;
    FrameMesh mesh = carved.mesh();
    ASSERT_EQ(topology_of(mesh).euler, without);
    ASSERT_EQ(topology_of(mesh).components, components->size());

    Inspected now(carved, mesh);
    const std::vector<double> thickness(carved.particles.size(), 0.3);
    EXPECT_EQ(patch_topology(now.trials, thickness, surface), 1u);
    const MeshTopology topology = topology_of(mesh);
    EXPECT_EQ(topology.euler, *euler);
    EXPECT_EQ(topology.components, components->size());
    expect_sound(mesh);
    EXPECT_EQ(mesh.on_surface.size(), mesh.vertices.size());
    EXPECT_EQ(mesh.carved.particle.size(), mesh.vertices.size());
    EXPECT_EQ(mesh.carved.inside_cell.size(), mesh.carved.triangles.size());
    // Now there is nothing to patch.
    EXPECT_EQ(patch_topology(now.trials, thickness, surface), 0u);
}

TEST(Patches, FillAHoleInAThinSheet) {
    expect_patched(thin_disk_and_ball(), {0.5, 0.5, 0.0}, 0.6, 2);
}

/// A ring of about a voxel and a half across.
openvdb::FloatGrid::Ptr thin_ring() {
    auto grid = openvdb::FloatGrid::create(3.0f);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    auto values = grid->getAccessor();
    for (int x = -13; x <= 13; ++x)
        for (int y = -13; y <= 13; ++y)
            for (int z = -6; z <= 6; ++z) {
                const double ring = std::hypot(std::hypot(x + 0.2, y - 0.1) - 7.3, z + 0.1) - 0.85;
                values.setValue({x, y, z}, static_cast<float>(std::min(ring, 3.0)));
            }
    return grid;
}

TEST(Patches, CloseARingThatIsCut) {
    expect_patched(thin_ring(), {7.0, 0.0, 0.0}, 0.9, 2);
}

double to_balls(const Vec3& p) {
    const double ball = (p - Vec3(0.1, 0.2, 0.3)).norm() - 5.3, drop = (p - Vec3(8.1, 0.4, 0.6)).norm() - 1.3;
    return std::min(ball, drop);
}
double to_balls_and_another(const Vec3& p) {
    return std::min(to_balls(p), (p - Vec3(-8.1, 0.2, 0.1)).norm() - 1.3);
}

openvdb::FloatGrid::Ptr grid_of(double (*distance)(const Vec3&)) {
    auto grid = openvdb::FloatGrid::create(3.0f);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    auto values = grid->getAccessor();
    for (int x = -12; x <= 12; ++x)
        for (int y = -9; y <= 9; ++y)
            for (int z = -9; z <= 9; ++z)
                values.setValue({x, y, z},
                                static_cast<float>(std::clamp(distance(Vec3(x, y, z)), -3.0, 3.0)));
    return grid;
}

TEST(Patches, PartADropFromABallWhereNoNodeTellsThemApart) {
    // In the mesh a tube between the lattice lines joins them. The other drop is not in it: that, which
    // patches do not mend, is what draws attention.
    const auto joined = shapes::from_function(
        [](const Vec3& p) {
            const double tube = std::hypot(p.y() - 0.5, p.z() - 0.5) - 0.3;
            return std::min(to_balls(p), std::max({tube, 4.0 - p.x(), p.x() - 8.0}));
        },
        Box(Vec3(-7, -7, -7), Vec3(11, 7, 7)), 0.25);
    const Carved carved(*joined, 0.5, 0.3);
    FrameMesh mesh = carved.mesh();
    ASSERT_EQ(topology_of(mesh).components, 1u);
    ASSERT_EQ(topology_of(mesh).euler, 2);

    const LevelSet surface(grid_of(to_balls_and_another));
    Inspected now(surface, carved.limits, mesh);
    for (const Vec3& fault : now.inspection.topology.faults) EXPECT_LT(fault.x(), -6.0);
    patch_topology(now.trials, std::vector<double>(carved.particles.size(), 9.0), surface);
    EXPECT_EQ(topology_of(mesh).components, 2u);
    EXPECT_EQ(topology_of(mesh).euler, 4);
    for (const Vec3& v : mesh.vertices) EXPECT_LT(std::abs(to_balls(v)), 0.3);
    expect_sound(mesh);
}

TEST(Patches, AreTheSameAtAnyNumberOfThreads) {
    const LevelSet surface(thin_disk_and_ball());
    const auto patched = [&](std::size_t threads) {
        const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
        Carved carved(surface, 0.5, 0.8);
        for (int c = 0; c < static_cast<int>(carved.labels.size()); ++c)
            if (carved.labels[c] && (carved.centroid(c) - Vec3(0.5, 0.5, 0.0)).norm() < 0.6)
                carved.labels[c] = 0;
        FrameMesh mesh = carved.mesh();
        Inspected now(carved, mesh);
        patch_topology(now.trials, std::vector<double>(carved.particles.size(), 0.3), surface);
        return mesh;
    };
    const FrameMesh one = patched(1), two = patched(2);
    EXPECT_EQ(one.vertices, two.vertices);
    EXPECT_EQ(one.carved.triangles, two.carved.triangles);
}

TEST(MeshTrials, TakeNoMeshThatIsFartherOffOrMissesMore) {
    const LevelSet surface(grid_of(to_balls));
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
        EXPECT_FALSE(now.trials.try_mesh(other));
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
    EXPECT_TRUE(now.trials.try_mesh(nearer));
    EXPECT_FALSE(now.trials.try_to_mend(before));  // nothing fails
    EXPECT_EQ(mesh.carved.triangles, nearer.carved.triangles);
}

TEST(Patches, MendWhatIsTooFarOffAndLeaveTheRest) {
    const LevelSet surface(grid_of(to_balls));
    const Carved carved(surface, 0.5, 0.8);
    FrameMesh mesh = carved.mesh();
    const FrameMesh before = mesh;
    const auto dent = std::max_element(mesh.vertices.begin(), mesh.vertices.end(),
                                       [](const Vec3& a, const Vec3& b) { return a.y() < b.y(); });
    *dent -= Vec3(0.0, 0.9, 0.0);
    const Vec3 place = *dent;
    const MeshTopology topology = topology_of(mesh);
    Inspected now(carved, mesh);
    const std::vector<double> thickness(carved.particles.size(), 9.0);
    ASSERT_FALSE(now.trials.failing_places().empty());
    EXPECT_GT(patch_failing(now.trials, thickness, surface), 0u);

    EXPECT_TRUE(now.trials.failing_places().empty());
    for (const auto& [i, j, k] : mesh.carved.triangles)
        for (const Vec3& p : {mesh.vertices[i], Vec3(0.5 * (mesh.vertices[i] + mesh.vertices[j])),
                              Vec3((mesh.vertices[i] + mesh.vertices[j] + mesh.vertices[k]) / 3.0)})
            EXPECT_LT(std::abs(to_balls(p)), 0.5);
    EXPECT_EQ(topology_of(mesh).components, topology.components);
    EXPECT_EQ(topology_of(mesh).euler, topology.euler);
    expect_sound(mesh);
    const auto has = [](const FrameMesh& some, const Vec3& v) {
        return std::find(some.vertices.begin(), some.vertices.end(), v) != some.vertices.end();
    };
    for (const Vec3& v : before.vertices) EXPECT_TRUE((v - place).norm() < 4.0 || has(mesh, v));
    // Now there is nothing to mend.
    EXPECT_EQ(patch_failing(now.trials, thickness, surface), 0u);
}

TEST(Patches, MendWhatIsTurnedOver) {
    const LevelSet surface(grid_of(to_balls));
    const Carved carved(surface, 0.5, 0.8);
    FrameMesh mesh = carved.mesh();
    const auto top = std::max_element(mesh.vertices.begin(), mesh.vertices.end(),
                                      [](const Vec3& a, const Vec3& b) { return a.y() < b.y(); });
    // Along the surface past its neighbours: nothing is farther off.
    *top = *surface.probe()->project(*top + Vec3(2.0, -0.3, 0.3));
    Inspected now(carved, mesh);
    ASSERT_TRUE(now.inspection.missed.empty());
    ASSERT_FALSE(now.trials.failing_places().empty());
    TrackedFrame frame;
    frame.tolerance = 0.5;
    report(mesh, now.inspection, surface, frame);
    EXPECT_LE(frame.max_error, 0.5);
    EXPECT_GE(frame.most_turned_deg, kTurnedOverDeg);
    EXPECT_FALSE(frame.within_tolerance);

    EXPECT_GT(patch_failing(now.trials, std::vector<double>(carved.particles.size(), 9.0), surface), 0u);
    EXPECT_TRUE(now.trials.failing_places().empty());
    expect_sound(mesh);
    const Vec3 middle(0.1, 0.2, 0.3);
    for (const auto& [i, j, k] : mesh.carved.triangles) {
        const Vec3 &a = mesh.vertices[i], &b = mesh.vertices[j], &c = mesh.vertices[k];
        const Vec3 area = (b - a).cross(c - a);
        const bool is_high = area.norm() > 0.5 * std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
        EXPECT_TRUE((a - middle).norm() > 6.0 || !is_high || area.dot(a - middle) > 0.0);
    }
    TrackedFrame mended;
    mended.tolerance = 0.5;
    report(mesh, now.inspection, surface, mended);
    EXPECT_TRUE(mended.within_tolerance);
}

/// A ball with a spike of one line of nodes.
openvdb::FloatGrid::Ptr ball_with_spike() {
    auto grid = openvdb::FloatGrid::create(3.0f);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    auto values = grid->getAccessor();
    for (int x = -9; x <= 16; ++x)
        for (int y = -9; y <= 9; ++y)
            for (int z = -9; z <= 9; ++z) {
                const double spike = std::max({std::hypot(y, z) - 0.45, 2.0 - x, x - 12.2}),
                             ball = (Vec3(x, y, z) - Vec3(0.2, 0.1, 0.3)).norm() - 5.3;
                values.setValue({x, y, z}, static_cast<float>(std::clamp(std::min(spike, ball), -3.0, 3.0)));
            }
    return grid;
}

/// Of the ball with its spike cut through at some places: joins specks at this tolerance, then removes what
/// is left.
void cut_a_spike(const std::vector<double>& at, double tolerance, std::size_t joined, bool reaches_its_end) {
    const LevelSet surface(ball_with_spike());
    Carved carved(surface, tolerance, 0.3);
    const auto topology = [](const FrameMesh& mesh) {
        return mesh_topology({mesh.vertices, mesh.carved.triangles, {}, {}});
    };
    ASSERT_EQ(topology(carved.mesh()).components, 1u);
    ASSERT_EQ(topology(carved.mesh()).euler, 2);
    for (int c = 0; c < static_cast<int>(carved.labels.size()); ++c)
        for (const double x : at)
            if (carved.labels[c] && std::abs(carved.centroid(c).x() - x) < 0.5) carved.labels[c] = 0;
    FrameMesh mesh = carved.mesh();
    ASSERT_GT(topology(mesh).components, 1u);

    Inspected now(carved, mesh);
    for (std::size_t t = 0; t < mesh.carved.triangles.size(); ++t) {
        const double x = mesh.vertices[mesh.carved.triangles[t][0]].x();
        if (x > 8.5 && x < 10.5) continue;
        EXPECT_EQ(now.inspection.topology.speck[t] != 0, x > 9.5);
    }
    EXPECT_EQ(join_specks(now.trials, carved.labels, carved.carve_labels(), carved.cells, carved.particles,
                          surface, carved.limits),
              joined);
    remove_specks(mesh, now.inspection, now.inspector, carved.limits);
    EXPECT_EQ(topology(mesh).components, 1u);
    EXPECT_EQ(topology(mesh).euler, 2);
    EXPECT_TRUE(topology(mesh).closed() && topology(mesh).manifold());
    EXPECT_TRUE(now.inspection.missed.empty());
    EXPECT_EQ(
        std::any_of(mesh.vertices.begin(), mesh.vertices.end(), [](const Vec3& p) { return p.x() > 11.9; }),
        reaches_its_end);
}

TEST(Specks, AreJoinedWhereSomethingWouldBeMissedWithoutThem) {
    cut_a_spike({9.5}, 0.5, 1, true);
    cut_a_spike({9.5, 11.2}, 0.5, 2, true);
}

TEST(Specks, AreRemovedWhereNothingIsMissedWithoutThem) {
    cut_a_spike({9.5}, 5.0, 0, false);
}

/// A ball, and beside it nodes that are inside by little: one alone and two in a row.
openvdb::FloatGrid::Ptr ball_and_single_nodes() {
    auto grid = openvdb::FloatGrid::create(3.0f);
    grid->setGridClass(openvdb::GRID_LEVEL_SET);
    auto values = grid->getAccessor();
    for (int x = -9; x <= 18; ++x)
        for (int y = -9; y <= 9; ++y)
            for (int z = -9; z <= 9; ++z) {
                const double ball = (Vec3(x, y, z) - Vec3(0.2, 0.1, 0.3)).norm() - 5.3;
                values.setValue({x, y, z}, static_cast<float>(std::clamp(ball, -3.0, 3.0)));
            }
    values.setValue({9, 0, 0}, -0.01f);
    values.setValue({13, 2, 0}, -0.02f);
    values.setValue({13, 3, 0}, -0.3f);
    return grid;
}

TEST(LostDrops, ArePutInWhereTheMeshHasNothingOfThem) {
    const LevelSet surface(ball_and_single_nodes());
    Carved carved(surface, 0.5, 0.5);
    for (int c = 0; c < static_cast<int>(carved.labels.size()); ++c)
        if ((carved.centroid(c) - Vec3(0.2, 0.1, 0.3)).norm() > 5.28) carved.labels[c] = 0;
    FrameMesh mesh = carved.mesh();
    const auto as_mesh = [&] { return TriangleMesh{mesh.vertices, mesh.carved.triangles, {}, {}}; };
    const std::size_t components = mesh_topology(as_mesh()).components;
    const long euler = mesh_topology(as_mesh()).euler;
    const std::size_t vertices = mesh.vertices.size();

    Inspected now(carved, mesh);
    const auto lost = now.inspection.topology.lost;
    ASSERT_EQ(lost.size(), 2u);
    EXPECT_EQ(lost[0].size() + lost[1].size(), 3u);
    EXPECT_TRUE(put_in_drops(lost, mesh, now.inspection, now.inspector, surface));
    const MeshTopology then = mesh_topology(as_mesh());
    EXPECT_EQ(then.components, components + 2);
    EXPECT_EQ(then.euler, euler + 4);
    EXPECT_TRUE(then.closed() && then.oriented() && then.manifold());
    EXPECT_TRUE(self_intersections(as_mesh()).empty());
    EXPECT_EQ(now.inspection.errors->size(), mesh.carved.triangles.size());
    EXPECT_EQ(mesh.on_surface.size(), mesh.vertices.size());
    EXPECT_EQ(mesh.carved.particle.size(), mesh.vertices.size());
    for (std::size_t v = vertices; v < mesh.vertices.size(); ++v) {
        EXPECT_EQ(mesh.carved.particle[v], -1);
        EXPECT_LT(std::abs(surface.probe()->value(mesh.vertices[v])), 0.2);
    }
    now.inspector.inspect_topology(mesh, now.inspection);
    EXPECT_TRUE(now.inspection.topology.lost.empty());
    EXPECT_FALSE(put_in_drops({}, mesh, now.inspection, now.inspector, surface));
}

TEST(LostDrops, AreLeftOutWhereTheyWouldCrossTheMesh) {
    const LevelSet surface(ball_and_single_nodes());
    Carved carved(surface, 0.5, 0.5);
    FrameMesh mesh = carved.mesh();
    Inspected now(carved, mesh);
    // Through a vertex of the mesh, so that every size of drop would cross it.
    const auto at_vertex =
        std::min_element(mesh.vertices.begin(), mesh.vertices.end(), [](const Vec3& a, const Vec3& b) {
            const auto off = [](const Vec3& p) { return (p - Vec3(p.array().round())).norm(); };
            return off(a) < off(b);
        });
    const Vec3 node = at_vertex->array().round();
    const Vec3 shift = node - *at_vertex;
    for (Vec3& v : mesh.vertices) v += shift;
    const std::size_t before = mesh.carved.triangles.size();
    EXPECT_FALSE(put_in_drops({{node}}, mesh, now.inspection, now.inspector, surface));
    EXPECT_EQ(mesh.carved.triangles.size(), before);
    EXPECT_EQ(mesh.vertices.size(), mesh.on_surface.size());
}

}  // namespace
}  // namespace isotrack
