#include "meshing/facet_values.h"

#include <algorithm>
#include <cstddef>

#include "parallel_for_each.h"
#include "surface/thread_probes.h"

namespace isotrack {
namespace {

constexpr std::size_t kGrain = 64;

/// The number of the point that is `i` steps from the first corner to the second and `j` to the third.
constexpr int number_of(int i, int j) {
    int n = j;
    for (int row = 0; row < i; ++row) n += FacetValues::kSteps + 1 - row;
    return n;
}
constexpr int kEnd = FacetValues::kSteps, kInside = number_of(1, 1);
constexpr int kAtCorner[3] = {number_of(0, 0), number_of(kEnd, 0), number_of(0, kEnd)};
/// Of the edge opposite each corner, from the next corner on.
constexpr int kOnEdge[3][2] = {{number_of(2, 1), number_of(1, 2)},
                               {number_of(0, 2), number_of(0, 1)},
                               {number_of(1, 0), number_of(2, 0)}};

}  // namespace

std::vector<FacetValues> facet_values(const std::vector<Vec3>& vertices,
                                      const std::vector<Triangle>& triangles, const Corners& corners,
                                      const Surface& surface) {
    std::vector<FacetValues> facets(triangles.size());
    ThreadProbes probes(surface);
    const auto read = [&](std::size_t t, int n, Surface::Probe& probe) {
        const auto& [i, j, k] = triangles[t];
        facets[t].read(n, vertices[i], vertices[j], vertices[k], probe);
    };
    parallel_for_each(triangles.size(), kGrain, [&](std::size_t t) {
        const auto& [i, j, k] = triangles[t];
        facets[t] = {vertices[i], vertices[j], vertices[k]};
        Surface::Probe& probe = probes.local();
        read(t, kInside, probe);
        for (int opposite = 0; opposite < 3; ++opposite)
            if (triangles[t][(opposite + 1) % 3] < triangles[t][(opposite + 2) % 3])
                for (const int n : kOnEdge[opposite]) read(t, n, probe);
    });
    parallel_for_each(triangles.size(), kGrain, [&](std::size_t t) {
        Surface::Probe& probe = probes.local();
        for (int opposite = 0; opposite < 3; ++opposite) {
            const auto& on_edge = kOnEdge[opposite];
            const int from = triangles[t][(opposite + 1) % 3], to = triangles[t][(opposite + 2) % 3];
            if (from < to) continue;
            const auto [third, other] = corners.beyond(to, from, triangles);
            if (other < 0) {
                for (const int n : on_edge) read(t, n, probe);
                continue;
            }
            const Triangle& mate = triangles[other];
            const auto& theirs = kOnEdge[std::find(mate.begin(), mate.end(), third) - mate.begin()];
            facets[t].value[on_edge[0]] = facets[other].value[theirs[1]];
            facets[t].value[on_edge[1]] = facets[other].value[theirs[0]];
        }
    });
    parallel_for_each(vertices.size(), kGrain, [&](std::size_t v) {
        const int first = corners.first[v], end = corners.first[v + 1];
        if (first == end) return;
        const auto value = static_cast<float>(probes.local().value(vertices[v]));
        for (int e = first; e < end; ++e)
            facets[corners.corner[e] / 3].value[kAtCorner[corners.corner[e] % 3]] = value;
    });
    return facets;
}

}  // namespace isotrack
