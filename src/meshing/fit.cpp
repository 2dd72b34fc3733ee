#include "isotrack/meshing/fit.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <limits>
#include <memory>

namespace isotrack {
namespace {

// The closed Newton-Cotes rule of degree 3 over a triangle: exact for the parabola that a curved surface
// makes under a facet.
constexpr int kLattice = 3;
constexpr double kWeight[3] = {54.0, 9.0, 4.0};  // in the middle, on an edge, in a corner

constexpr double kLargestStep = 0.1;  // of the shortest edge around a vertex

/// The triangles around each vertex: those of v are entries first[v] to first[v + 1] - 1, as 3 * triangle +
/// corner.
struct Corners {
    std::vector<int> first, corner;
    Corners(std::size_t vertices, const std::vector<Triangle>& triangles)
        : first(vertices + 1, 0), corner(3 * triangles.size()) {
        for (const Triangle& t : triangles)
            for (const int v : t) ++first[v + 1];
        for (std::size_t v = 0; v < vertices; ++v) first[v + 1] += first[v];
        std::vector<int> end(first.begin(), first.end() - 1);
        for (std::size_t t = 0; t < triangles.size(); ++t)
            for (int k = 0; k < 3; ++k) corner[end[triangles[t][k]]++] = static_cast<int>(3 * t) + k;
    }
};

}  // namespace

void fit(std::vector<Vec3>& vertices, const std::vector<Triangle>& triangles,
         const std::vector<Vec3>& normals, const Surface& surface, int steps) {
    const Corners corners(vertices.size(), triangles);
    std::vector<double> limit(vertices.size(), std::numeric_limits<double>::infinity());
    for (const Triangle& t : triangles)
        for (int k = 0; k < 3; ++k) {
            const double edge = kLargestStep * (vertices[t[k]] - vertices[t[(k + 1) % 3]]).norm();
            for (const int end : {t[k], t[(k + 1) % 3]}) limit[end] = std::min(limit[end], edge);
        }
    struct Share {
        double value, weight;
    };
    std::vector<std::array<Share, 3>> shares(triangles.size());
    tbb::enumerable_thread_specific<std::unique_ptr<Surface::Probe>> probes([&] { return surface.probe(); });
    for (int step = 0; step < steps; ++step) {
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, triangles.size(), 64), [&](const auto& range) {
            Surface::Probe& probe = *probes.local();
            for (std::size_t t = range.begin(); t < range.end(); ++t) {
                const Vec3 &a = vertices[triangles[t][0]], &b = vertices[triangles[t][1]],
                           &c = vertices[triangles[t][2]];
                const double area = (b - a).cross(c - a).norm();
                shares[t] = {};
                for (int i = 0; i <= kLattice; ++i)
                    for (int j = 0; i + j <= kLattice; ++j) {
                        const double u = static_cast<double>(i) / kLattice,
                                     v = static_cast<double>(j) / kLattice;
                        const double w[3] = {1.0 - u - v, u, v};
                        const int zeros = (i == 0) + (j == 0) + (i + j == kLattice);
                        const double share = area * kWeight[zeros];
                        const double value = probe.value(w[0] * a + w[1] * b + w[2] * c);
                        for (int k = 0; k < 3; ++k) {
                            shares[t][k].value += share * w[k] * value;
                            shares[t][k].weight += share * w[k];
                        }
                    }
            }
        });
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, vertices.size(), 512), [&](const auto& range) {
            for (std::size_t v = range.begin(); v < range.end(); ++v) {
                double value = 0.0, weight = 0.0;
                for (int e = corners.first[v]; e < corners.first[v + 1]; ++e) {
                    const Share& s = shares[corners.corner[e] / 3][corners.corner[e] % 3];
                    value += s.value;
                    weight += s.weight;
                }
                if (weight > 0.0) vertices[v] -= std::clamp(value / weight, -limit[v], limit[v]) * normals[v];
            }
        });
    }
}

}  // namespace isotrack
