#include "tracking/last_mesh.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <atomic>
#include <limits>
#include <utility>

#include "atomic_extremes.h"
#include "sampling/compact.h"

namespace isotrack {
namespace {

/// The distance to the nearest Delaunay neighbour that faces the other way.
std::vector<double> thickness_of(const Particles& particles, const Tetrahedra& cells) {
    std::vector<std::atomic<double>> th(particles.size());  // lowered by several threads
    for (auto& own : th) own.store(std::numeric_limits<double>::infinity(), std::memory_order_relaxed);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, cells.size(), 4096), [&](const auto& range) {
        for (std::size_t c = range.begin(); c < range.end(); ++c)
            for (int a = 0; a < 4; ++a)
                for (int b = a + 1; b < 4; ++b) {
                    const int i = cells.vertices[c][a], j = cells.vertices[c][b];
                    if (i < 0 || j < 0 || !(particles.normal[i].dot(particles.normal[j]) < 0.0)) continue;
                    const double apart = (particles.position[i] - particles.position[j]).norm();
                    lower_to(th[i], apart);
                    lower_to(th[j], apart);
                }
    });
    return {th.begin(), th.end()};
}

}  // namespace

std::vector<Triangle> particle_triangles(const CarvedSurface& carved) {
    std::vector<Triangle> result;
    result.reserve(carved.triangles.size());
    for (const Triangle& t : carved.triangles) {
        const Triangle p = {carved.particle[t[0]], carved.particle[t[1]], carved.particle[t[2]]};
        if (p[0] >= 0 && p[1] >= 0 && p[2] >= 0) result.push_back(p);
    }
    return result;
}

void LastMesh::take(std::vector<Triangle> of_mesh) {
    triangles = std::move(of_mesh);
    ring = {};
}

void LastMesh::take(const CarvedSurface& carved, const Particles& particles, const Tetrahedra& cells) {
    take(particle_triangles(carved));
    evidence.error.resize(particles.size(), -1.0);
    evidence.thickness = thickness_of(particles, cells);
}

void LastMesh::make_ring(std::size_t particles) {
    ring = ring_of(triangles, particles);
}

void LastMesh::retain(const std::vector<char>& keep) {
    tbb::parallel_invoke([&] { ring = ring.restricted(keep); },
                         [&] {
                             compact(evidence.error, keep);
                             compact(evidence.thickness, keep);
                             const std::vector<int> number = numbers_after(keep);
                             std::size_t kept = 0;
                             for (const Triangle& t : triangles)
                                 if (keep[t[0]] && keep[t[1]] && keep[t[2]])
                                     triangles[kept++] = {number[t[0]], number[t[1]], number[t[2]]};
                             triangles.resize(kept);
                         });
}

void LastMesh::reorder(const std::vector<int>& order) {
    isotrack::reorder(evidence.error, order);
    isotrack::reorder(evidence.thickness, order);
    std::vector<int> place(order.size());
    for (std::size_t i = 0; i < order.size(); ++i) place[order[i]] = static_cast<int>(i);
    for (Triangle& t : triangles)
        for (int& corner : t) corner = place[corner];
    make_ring(order.size());
}

void LastMesh::grow(std::size_t particles, const std::vector<Triangle>& parents) {
    triangles.reserve(triangles.size() + 3 * parents.size());
    for (std::size_t k = 0; k < parents.size(); ++k) {
        const auto& [a, b, c] = parents[k];
        const int i = static_cast<int>(ring.size() + k);
        triangles.insert(triangles.end(), {{a, b, i}, {b, c, i}, {c, a, i}});
    }
    if (ring.size() != particles) ring = ring.extended(parents, particles);
    evidence.error.resize(particles, -1.0);
    evidence.thickness.resize(particles, std::numeric_limits<double>::infinity());
}

}  // namespace isotrack
