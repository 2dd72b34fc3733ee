#include "tracking/frame_mesh.h"

#include <algorithm>

#include "sampling/compact.h"
#include "surface/float_precision.h"

namespace isotrack {

std::vector<int> lone_vertices(const FrameMesh& mesh, std::size_t particles) {
    constexpr int kNone = -1, kSeveral = -2;
    std::vector<int> result(particles, kNone);
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v)
        if (const int p = mesh.carved.particle[v]; p >= 0)
            result[p] = result[p] == kNone ? static_cast<int>(v) : kSeveral;
    return result;
}

std::vector<char> lone_flags(const FrameMesh& mesh, const std::vector<int>& lone_vertices) {
    std::vector<char> result(mesh.vertices.size(), 0);
    for (const int v : lone_vertices)
        if (v >= 0) result[v] = 1;
    return result;
}

bool is_flipped(const CarvedSurface& carved, std::size_t triangle, const Tetrahedra& cells) {
    const int cell = carved.inside_cell(triangle);
    if (cell < 0) return false;
    const auto& facet = Tetrahedra::kFacet[carved.inside_facet(triangle)];
    const Triangle& t = carved.triangles[triangle];
    return std::any_of(t.begin(), t.end(), [&](int v) {
        const int p = carved.particle[v];  // negative at a midpoint, which splits a facet
        return p >= 0 && std::none_of(facet, facet + 3, [&](int k) { return cells.vertices[cell][k] == p; });
    });
}

std::vector<Vec3> unfitted_vertices(const CarvedSurface& carved, const std::vector<Vec3>& particles) {
    std::vector<Vec3> result;
    result.reserve(carved.particle.size());
    auto midpoint = carved.midpoints.begin();
    for (const int p : carved.particle)
        result.push_back(p >= 0 ? particles[p] : to_float_precision(*midpoint++));
    return result;
}

FrameMesh without(FrameMesh mesh, const std::vector<char>& left_out) {
    CarvedSurface& carved = mesh.carved;
    std::vector<char> keep;
    for (const char flag : left_out) keep.push_back(!flag);
    compact(carved.triangles, keep);
    compact(carved.facet, keep);
    keep.assign(mesh.vertices.size(), 0);
    for (const Triangle& t : carved.triangles)
        for (const int v : t) keep[v] = 1;
    std::vector<char> keep_midpoint;
    for (std::size_t v = 0; v < keep.size(); ++v)
        if (carved.particle[v] < 0) keep_midpoint.push_back(keep[v]);
    compact(mesh.vertices, keep);
    compact(carved.particle, keep);
    compact(carved.midpoints, keep_midpoint);
    const std::vector<int> number = numbers_after(keep);
    for (Triangle& t : carved.triangles)
        for (int& v : t) v = number[v];
    return mesh;
}

void append(FrameMesh& mesh, const std::vector<Vec3>& points, const std::vector<Triangle>& triangles) {
    CarvedSurface& carved = mesh.carved;
    for (auto* to : {&mesh.vertices, &carved.midpoints}) to->insert(to->end(), points.begin(), points.end());
    carved.triangles.insert(carved.triangles.end(), triangles.begin(), triangles.end());
    carved.particle.resize(mesh.vertices.size(), -1);
    carved.facet.resize(carved.triangles.size(), CarvedSurface::kNoFacet);
}

}  // namespace isotrack
