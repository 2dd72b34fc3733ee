#include "tracking/refitted.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <numeric>
#include <utility>

#include "isotrack/meshing/refit.h"
#include "isotrack/meshing/self_intersections.h"
#include "meshing/crossing_triangles.h"
#include "meshing/sharpness.h"
#include "meshing/triangle_box.h"
#include "surface/float_precision.h"

namespace isotrack {
namespace {

constexpr double kPoor = 0.1;   // of the tolerance: a triangle with a larger RMS error is worth the time
constexpr double kReach = 1.5;  // tolerances: a triangle that near may have stood for a crossing

/// What a refit changed, and can be taken back: flips by groups that share triangles, vertices one by one.
class Refitted {
public:
    Refitted(FrameMesh& mesh, const std::vector<char>& movable, const Surface& surface, double tolerance)
        : mesh_(mesh),
          vertices_(mesh.vertices),
          triangles_(mesh.carved.triangles),
          inside_cell_(mesh.carved.inside_cell),
          tolerance_(tolerance),
          next_(triangles_.size()),
          sharpest_(triangles_.size()),
          normal_(triangles_.size()) {
        std::iota(next_.begin(), next_.end(), 0);
        for (std::size_t t = 0; t < triangles_.size(); ++t) {
            sharpest_[t] = sharpness_of(t);
            normal_[t] = area_vector(t);
        }
        for (const auto& [t, u] : refit(mesh.vertices, mesh.carved.triangles, surface, tolerance, movable))
            unite(static_cast<std::size_t>(t), static_cast<std::size_t>(u));
        for (Vec3& v : mesh.vertices) v = to_float_precision(v);
        for (std::size_t t = 0; t < triangles_.size(); ++t)
            if (is_flipped(t)) mesh.carved.inside_cell[t] = CarvedSurface::kNoCell;
    }

    bool is_changed(std::size_t t) const {
        const Triangle& now = mesh_.carved.triangles[t];
        return is_flipped(t) ||
               std::any_of(now.begin(), now.end(), [&](int v) { return mesh_.vertices[v] != vertices_[v]; });
    }
    /// Whether a triangle turned over or got too sharp. Those on new diagonals did neither when they were
    /// made; they are held against the sum of those they stand for.
    bool is_spoilt(std::size_t t) const {
        Vec3 before = normal_[t];
        double sharpest = std::max(kSharpnessAt30Degrees, sharpest_[t]);
        for (std::size_t u = next_[t]; u != t; u = next_[u]) {
            before += normal_[u];
            sharpest = std::max(sharpest, sharpest_[u]);
        }
        return !(area_vector(t).dot(before) > 0.0) || !(sharpness_of(t) <= sharpest);
    }
    std::vector<Surface::Crossing> newly_missed(const Inspection& now, const Inspector& inspector) const {
        return inspector.newly_missed(now, vertices_, triangles_);
    }
    bool is_near(std::size_t t, const Vec3& place) const {
        const double reach = kReach * tolerance_;
        return box_of(mesh_.vertices, mesh_.carved.triangles[t]).exteriorDistance(place) <= reach ||
               box_of(vertices_, triangles_[t]).exteriorDistance(place) <= reach;
    }

    /// Takes back what is around these triangles; where nothing is, a ring farther; all, where there is
    /// nothing either. Returns whether there was anything to take back.
    bool undo(std::vector<char> bad) {
        if (undo_at(bad)) return true;
        std::vector<char> ring(vertices_.size(), 0);
        for (std::size_t t = 0; t < bad.size(); ++t)
            if (bad[t])
                for (const int v : mesh_.carved.triangles[t]) ring[v] = 1;
        for (std::size_t t = 0; t < bad.size(); ++t)
            for (const int v : mesh_.carved.triangles[t]) bad[t] = bad[t] || ring[v];
        return undo_at(bad) || undo_at(std::vector<char>(bad.size(), 1));
    }

private:
    bool is_flipped(std::size_t t) const { return next_[t] != t; }

    void unite(std::size_t t, std::size_t u) {
        for (std::size_t w = next_[t]; w != t; w = next_[w])
            if (w == u) return;
        std::swap(next_[t], next_[u]);  // joins the two cycles
    }

    bool undo_at(const std::vector<char>& bad) {
        bool any = false;
        for (std::size_t t = 0; t < bad.size(); ++t) {
            if (!bad[t] || !is_changed(t)) continue;
            any = true;
            for (std::size_t u = t;;) {
                mesh_.carved.triangles[u] = triangles_[u];
                mesh_.carved.inside_cell[u] = inside_cell_[u];
                for (const int v : triangles_[u]) mesh_.vertices[v] = vertices_[v];
                const std::size_t next = next_[u];
                next_[u] = u;
                if (next == t) break;
                u = next;
            }
        }
        return any;
    }

    double sharpness_of(std::size_t t) const {
        const auto& [i, j, k] = mesh_.carved.triangles[t];
        return sharpness(mesh_.vertices[i], mesh_.vertices[j], mesh_.vertices[k]);
    }
    Vec3 area_vector(std::size_t t) const {
        const auto& [i, j, k] = mesh_.carved.triangles[t];
        return (mesh_.vertices[j] - mesh_.vertices[i]).cross(mesh_.vertices[k] - mesh_.vertices[i]);
    }

    FrameMesh& mesh_;
    const std::vector<Vec3> vertices_;  // this and what follows: before
    const std::vector<Triangle> triangles_;
    const decltype(CarvedSurface::inside_cell) inside_cell_;
    const double tolerance_;
    std::vector<std::size_t> next_;  // in a cycle through the triangles of a group
    std::vector<double> sharpest_;
    std::vector<Vec3> normal_;
};

/// Flags for the vertices around triangles that are worth it.
std::vector<char> poor_vertices(const FrameMesh& mesh, const Inspection& inspection, double tolerance) {
    std::vector<char> result(mesh.vertices.size(), 0);
    for (std::size_t t = 0; t < mesh.carved.triangles.size(); ++t)
        if ((*inspection.errors)[t].mean_square > kPoor * tolerance * kPoor * tolerance)
            for (const int v : mesh.carved.triangles[t]) result[v] = 1;
    return result;
}

/// Of triangles that cross others, where one of them is unchecked.
std::vector<char> crossing_flags(const FrameMesh& mesh, const std::vector<char>& unchecked) {
    if (!unchecked.empty()) return crossing_triangles(mesh.vertices, mesh.carved.triangles, unchecked);
    std::vector<char> result(mesh.carved.triangles.size(), 0);
    for (const auto& [t, u] : self_intersections({mesh.vertices, mesh.carved.triangles, {}, {}}))
        result[t] = result[u] = 1;
    return result;
}

}  // namespace

Inspection refit_within(FrameMesh& mesh, const Inspection& before, const std::vector<char>& movable,
                        const Surface& surface, double tolerance, Inspector& inspector) {
    std::vector<char> moving = poor_vertices(mesh, before, tolerance);
    for (std::size_t v = 0; v < moving.size(); ++v) moving[v] = moving[v] && movable[v];
    Refitted refitted(mesh, moving, surface, tolerance);
    std::vector<char> unchecked;  // triangles that may cross others since that was looked at; empty: all
    for (;;) {
        Inspection inspection = inspector.inspect_both_ways(mesh);
        inspector.look_between(mesh, inspection);
        std::vector<char> bad(mesh.carved.triangles.size(), 0);
        const std::vector<Surface::Crossing> missed = refitted.newly_missed(inspection, inspector);
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, bad.size(), 1024), [&](const auto& range) {
            for (std::size_t t = range.begin(); t < range.end(); ++t) {
                const TriangleError &now = (*inspection.errors)[t], &then = (*before.errors)[t];
                bad[t] =
                    refitted.is_changed(t) &&
                    (now.largest > std::max(tolerance, then.largest) ||
                     now.turned_deg > std::max(kMostTurnedDeg, then.turned_deg) || refitted.is_spoilt(t) ||
                     std::any_of(missed.begin(), missed.end(),
                                 [&](const auto& c) { return refitted.is_near(t, c.point); }));
            }
        });
        const std::vector<char> crossing = crossing_flags(mesh, unchecked);
        for (std::size_t t = 0; t < bad.size(); ++t) bad[t] = bad[t] || crossing[t];
        const std::vector<Vec3> vertices = mesh.vertices;
        const std::vector<Triangle> triangles = mesh.carved.triangles;
        if (std::find(bad.begin(), bad.end(), 1) == bad.end() || !refitted.undo(std::move(bad)))
            return inspection;
        unchecked.assign(triangles.size(), 0);
        for (std::size_t t = 0; t < triangles.size(); ++t) {
            const Triangle& now = mesh.carved.triangles[t];
            unchecked[t] = now != triangles[t] || std::any_of(now.begin(), now.end(), [&](int v) {
                               return mesh.vertices[v] != vertices[v];
                           });
        }
    }
}

}  // namespace isotrack
