#include "tracking/fitted.h"

#include <algorithm>
#include <utility>

#include "isotrack/meshing/fit.h"
#include "isotrack/meshing/self_intersections.h"
#include "surface/float_precision.h"

namespace isotrack {
namespace {

constexpr int kFitSteps = 9;

}  // namespace

void Fitted::take(const FrameMesh& mesh, std::size_t particles) {
    position_.resize(particles);
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v)
        if (const int p = mesh.carved.particle[v]; p >= 0) position_[p] = mesh.vertices[v];
}

void Fitted::fit_vertices(FrameMesh& mesh, std::size_t particles, const Surface& surface) {
    const auto& triangles = mesh.carved.triangles;
    const MeshFacets facets(mesh.carved, mesh.on_surface);
    std::vector<char> movable(mesh.vertices.size(), 0);
    compare(
        facets, facets_, [](std::size_t, std::size_t) {},
        [&](std::size_t f, const Facet&) {
            for (const int v : triangles[f]) movable[v] = 1;
        },
        [](std::size_t) {});
    std::vector<int> copies(particles, 0);  // of which only one place is known
    for (const int p : mesh.carved.particle)
        if (p >= 0) ++copies[p];
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
        const int p = mesh.carved.particle[v];
        if (p < 0 || copies[p] > 1) movable[v] = 1;
        if (!movable[v]) mesh.vertices[v] = position_[p];
    }
    constexpr int kRings = 2;
    for (int ring = 0; ring < kRings; ++ring) {
        const std::vector<char> before = movable;
        for (const Triangle& t : triangles)
            if (before[t[0]] || before[t[1]] || before[t[2]])
                for (const int v : t) movable[v] = 1;
    }
    fit(mesh.vertices, triangles, surface, kFitSteps, movable);
    for (Vec3& v : mesh.vertices) v = to_float_precision(v);
    facets.write_to(facets_);
    take(mesh, particles);
}

bool Fitted::undo_crossing(FrameMesh& mesh, std::size_t particles) {
    TriangleMesh tested;
    tested.triangles = mesh.carved.triangles;
    std::vector<char> undo(mesh.vertices.size(), 0);
    for (bool any = true; any;) {
        tested.points = mesh.vertices;
        any = false;
        const auto back = [&](int v) {
            undo[v] = 1;
            any = any || mesh.vertices[v] != mesh.on_surface[v];
        };
        for (const auto& pair : self_intersections(tested))
            for (const int t : {pair.first, pair.second})
                for (const int v : tested.triangles[t]) back(v);
        if (!any && std::count(undo.begin(), undo.end(), 1) == 0) break;
        for (std::size_t v = 0; v < undo.size(); ++v)
            if (undo[v]) mesh.vertices[v] = mesh.on_surface[v];
        if (!any) break;
        const std::vector<char> ring = undo;
        for (const Triangle& t : tested.triangles)
            if (ring[t[0]] || ring[t[1]] || ring[t[2]])
                for (const int v : t) undo[v] = 1;
    }
    take(mesh, particles);
    return std::find(undo.begin(), undo.end(), 1) != undo.end();
}

}  // namespace isotrack
