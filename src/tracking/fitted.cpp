#include "tracking/fitted.h"

#include <utility>

#include "isotrack/meshing/fit.h"
#include "isotrack/meshing/refit.h"
#include "isotrack/meshing/self_intersections.h"
#include "surface/float_precision.h"
#include "tracking/facets.h"

namespace isotrack {
namespace {

constexpr int kSteps = 4, kStepsBeforeFlips = 2;  // others follow these

void add_ring(std::vector<char>& flags, const std::vector<Triangle>& triangles) {
    const std::vector<char> before = flags;
    for (const Triangle& t : triangles)
        if (before[t[0]] || before[t[1]] || before[t[2]])
            for (const int v : t) flags[v] = 1;
}

}  // namespace

void Fitted::take(const FrameMesh& mesh, std::size_t particles) {
    position_.resize(particles);
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v)
        if (const int p = mesh.carved.particle[v]; p >= 0) position_[p] = mesh.vertices[v].cast<float>();
}

void Fitted::fit_vertices(FrameMesh& mesh, std::size_t particles, const Surface& surface,
                          std::optional<double> tolerance) {
    auto& triangles = mesh.carved.triangles;
    std::vector<FacetOfParticles> facets;
    facets.reserve(triangles.size());
    for (std::size_t t = 0; t < triangles.size(); ++t) {
        const auto& [i, j, k] = triangles[t];
        const auto& particle = mesh.carved.particle;
        facets.push_back({facet_key(mesh.carved, t), {particle[i], particle[j], particle[k]}});
    }
    std::vector<char> movable(mesh.vertices.size(), 0);
    std::vector<int> now(facets_.size(), -1);
    const auto take_same = [&](std::size_t f, std::size_t old) { now[old] = static_cast<int>(f); };
    const std::vector<std::size_t> came = compare(facets, facets_, take_same).came;
    for (const std::size_t f : came)
        for (const int v : triangles[f]) movable[v] = 1;
    facets_ = std::move(facets);
    const std::vector<int> vertex = lone_vertices(mesh, particles);
    const std::vector<char> lone = lone_flags(mesh, vertex);
    const bool is_first = 2 * came.size() > triangles.size();
    if (is_first) {
        flips_ = {};
        movable.assign(movable.size(), 1);
    }
    flips_.put_into(mesh.carved, now, vertex, movable);
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
        if (!lone[v]) movable[v] = 1;  // where it was is not known
        if (!movable[v]) mesh.vertices[v] = position_[mesh.carved.particle[v]].cast<double>();
    }
    const bool flips = is_first && tolerance;
    fit(mesh.vertices, triangles, surface, flips ? kStepsBeforeFlips : kSteps, movable);
    if (flips) {
        const std::vector<Triangle> before = triangles;
        flips_ = KeptFlips(refit(mesh.vertices, triangles, surface, *tolerance, lone), before, mesh.carved);
    }
    for (Vec3& v : mesh.vertices) v = to_float_precision(v);
    take(mesh, particles);
}

bool Fitted::undo_crossing(FrameMesh& mesh, const std::vector<Vec3>& particles) {
    auto crossing = self_intersections(mesh.vertices, mesh.carved.triangles);
    if (crossing.empty()) return false;
    const std::vector<Vec3> unfitted = unfitted_vertices(mesh.carved, particles);
    const std::vector<int> vertex = lone_vertices(mesh, particles.size());
    std::vector<char> undo(mesh.vertices.size(), 0);
    for (bool changed = true; changed && !crossing.empty();) {
        changed = false;
        for (const auto& [t, u] : crossing)
            for (const int of : {t, u})
                for (const int v : mesh.carved.triangles[of]) {
                    undo[v] = 1;
                    changed = changed || mesh.vertices[v] != unfitted[v];
                }
        changed = flips_.undo_at(undo, vertex, mesh.carved) || changed;
        for (std::size_t v = 0; v < undo.size(); ++v)
            if (undo[v]) mesh.vertices[v] = unfitted[v];
        add_ring(undo, mesh.carved.triangles);
        crossing = self_intersections(mesh.vertices, mesh.carved.triangles);
    }
    take(mesh, particles.size());
    return true;
}

}  // namespace isotrack
