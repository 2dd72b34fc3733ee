// Distances that are kept up to date while a mesh changes, against those measured anew.
#include "tracking/mesh_distances.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "isotrack/meshing/certify.h"
#include "isotrack/surface/shapes.h"
#include "support/meshes.h"
#include "surface/float_precision.h"

namespace isotrack {
namespace {

TEST(MeshDistances, AfterChangesAreThoseMeasuredAnew) {
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    const CrossingGrid grid(*sphere);
    TriangleMesh mesh = support::icosphere(2, {0, 0, 0}, 1.0);
    for (Vec3& p : mesh.points) p = to_float_precision(p);
    const auto corner = [&](int v) { return Eigen::Vector3f(mesh.points[v].cast<float>()); };
    const auto around = [&](int vertex) {
        std::vector<Facet> facets;
        for (const auto& [i, j, k] : mesh.triangles)
            if (i == vertex || j == vertex || k == vertex)
                facets.push_back({0, {corner(i), corner(j), corner(k)}});
        return facets;
    };
    for (const double cutoff : {0.05, 1.0})
        for (const double factor : {0.8, 1.1}) {  // away from crossings, and beyond some that it was near
            MeshDistances distances(grid, cutoff);
            distances.measure(mesh.points, mesh.triangles, {});
            TriangleMesh changed = mesh;
            changed.points[5] = to_float_precision(factor * mesh.points[5]);
            FacetChanges changes;
            changes.went = around(5);
            std::swap(mesh, changed);
            changes.came = around(5);
            changes.around = triangles_near_gone(changes.went, 2.01 * cutoff, mesh.points, mesh.triangles);
            distances.measure(mesh.points, mesh.triangles, changes);
            const auto anew = crossing_distances(mesh.points, mesh.triangles, grid, cutoff);
            std::swap(mesh, changed);
            const auto before = crossing_distances(mesh.points, mesh.triangles, grid, cutoff);
            EXPECT_NE(anew, before);
            for (std::size_t c = 0; c < grid.size(); ++c) EXPECT_EQ(distances[c], anew[c]) << c;
        }
}

TEST(MeshDistances, AfterChangesInARowAreThoseMeasuredAnew) {
    // Of a mesh that was near everywhere, the first change takes a corner away from crossings.
    const auto sphere = shapes::sphere({0, 0, 0}, 1.0, 0.1);
    const CrossingGrid grid(*sphere);
    constexpr double kCutoff = 1.0;
    constexpr int kMoved = 5;
    TriangleMesh mesh = support::icosphere(2, {0, 0, 0}, 1.0);
    for (Vec3& p : mesh.points) p = to_float_precision(p);
    const auto facets = [&] {
        std::vector<Facet> result;
        const auto corner = [&](int v) { return Eigen::Vector3f(mesh.points[v].cast<float>()); };
        for (const auto& [i, j, k] : mesh.triangles)
            if (i == kMoved || j == kMoved || k == kMoved)
                result.push_back({0, {corner(i), corner(j), corner(k)}});
        return result;
    };
    MeshDistances distances(grid, kCutoff);
    distances.measure(mesh.points, mesh.triangles, {});
    const double at_first = distances.survey(kCutoff).farthest;
    double farthest = 0.0;
    for (const double factor : {0.6, 1.5}) {
        FacetChanges changes;
        changes.went = facets();
        mesh.points[kMoved] = to_float_precision(factor * mesh.points[kMoved]);
        changes.came = facets();
        changes.around = triangles_near_gone(changes.went, 2.01 * kCutoff, mesh.points, mesh.triangles);
        distances.measure(mesh.points, mesh.triangles, changes);
        const auto anew = crossing_distances(mesh.points, mesh.triangles, grid, kCutoff);
        for (std::size_t c = 0; c < grid.size(); ++c) {
            EXPECT_EQ(distances[c], anew[c]) << factor << " " << c;
            farthest = std::max(farthest, distances[c]);
        }
    }
    EXPECT_GT(farthest, 2.0 * at_first);
}

TEST(MeshDistances, WhatTakesOverMayBeTwoCutoffsFromWhatWent) {
    // Crossings between two sheets, nearer to the one that goes.
    constexpr double kCutoff = 1.0, kGap = 1.8;
    std::vector<Surface::Crossing> crossings;
    for (double x = -1.0; x <= 1.0; x += 0.25)
        crossings.push_back({Vec3(x, 0.1, 0.85), Eigen::Vector3f::UnitZ()});
    const CrossingGrid grid(crossings, 0.25);
    const auto sheet = [](double z) { return std::vector<Vec3>{{-3, -3, z}, {3, -3, z}, {0, 3, z}}; };
    const std::vector<Triangle> triangles{{0, 1, 2}, {3, 4, 5}};
    const auto points_with = [&](double z) {
        std::vector<Vec3> points = sheet(kGap);
        const std::vector<Vec3> other = sheet(z);
        points.insert(points.end(), other.begin(), other.end());
        return points;
    };
    const auto facet = [&](double z) {
        const std::vector<Vec3> corner = sheet(z);
        return Facet{0, {corner[0].cast<float>(), corner[1].cast<float>(), corner[2].cast<float>()}};
    };
    MeshDistances distances(grid, kCutoff);
    distances.measure(points_with(0.0), triangles, {});
    FacetChanges changes;
    changes.went = {facet(0.0)};
    changes.came = {facet(-5.0)};
    const std::vector<Vec3> now = points_with(-5.0);
    changes.around = triangles_near_gone(changes.went, 2.01 * kCutoff, now, triangles);
    distances.measure(now, triangles, changes);
    for (std::size_t c = 0; c < grid.size(); ++c) EXPECT_NEAR(distances[c], kGap - 0.85, 1e-6) << c;

    EXPECT_EQ(triangles_near_gone(changes.went, 0.9 * kGap, now, triangles).size(), 0u);
}

}  // namespace
}  // namespace isotrack
