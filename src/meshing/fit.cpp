#include "isotrack/meshing/fit.h"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "meshing/corners.h"
#include "meshing/sharpness.h"
#include "surface/thread_probes.h"

namespace isotrack {
namespace {

// The points of the closed Newton-Cotes rule of degree 3 over a triangle, whose weights 54, 9 and 4 are exact
// for the parabola that a curved surface makes under a facet. Corners and edges count more here, where a
// fitted mesh is farthest from its surface: that lowers the largest error. Much more would cost the right
// volume.
constexpr int kLattice = 3;
constexpr double kWeight[3] = {54.0, 12.0, 7.0};  // in the middle, on an edge, in a corner

constexpr double kRelaxation = 1.5;   // the shares of the neighbours make each step too short
constexpr double kLargestStep = 0.1;  // of the shortest edge around a vertex
constexpr int kHalvings = 2;          // of the steps around a spoilt triangle, before they are taken back

/// A triangle's share in the normal equations of its corners.
struct Shares {
    Vec3 normal = Vec3::Zero();
    std::array<double, 3> value{}, weight{};
};

Shares shares_of(const Vec3& a, const Vec3& b, const Vec3& c, Surface::Probe& probe) {
    Shares result;
    const Vec3 cross = (b - a).cross(c - a);
    const double area2 = cross.norm();
    if (!(area2 > 0.0)) return result;
    result.normal = cross / area2;
    for (int i = 0; i <= kLattice; ++i)
        for (int j = 0; i + j <= kLattice; ++j) {
            const double u = static_cast<double>(i) / kLattice, v = static_cast<double>(j) / kLattice;
            const double w[3] = {1.0 - u - v, u, v};
            const int zeros = (i == 0) + (j == 0) + (i + j == kLattice);
            const double share = area2 * kWeight[zeros];
            const double value = probe.value(w[0] * a + w[1] * b + w[2] * c);
            for (int k = 0; k < 3; ++k) {
                result.value[k] += share * w[k] * value;
                result.weight[k] += share * w[k];
            }
        }
    return result;
}

/// Whether a triangle turns over by these steps, or gets too sharp and sharper than it was.
bool spoilt(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& a_to, const Vec3& b_to,
            const Vec3& c_to) {
    const Vec3 area = (b - a).cross(c - a);
    if (area == Vec3::Zero()) return false;
    if (!(area.dot((b_to - a_to).cross(c_to - a_to)) > 0.0)) return true;
    const double after = sharpness(a_to, b_to, c_to);
    return after > kSharpnessAt30Degrees && after > sharpness(a, b, c);
}

}  // namespace

void fit(std::vector<Vec3>& vertices, const std::vector<Triangle>& all_triangles, const Surface& surface,
         int steps, const std::vector<char>& movable, double damping) {
    const auto moves = [&](int v) { return movable.empty() || movable[v]; };
    std::vector<Triangle> triangles;
    std::vector<int> moving;
    for (const Triangle& t : all_triangles)
        if (moves(t[0]) || moves(t[1]) || moves(t[2])) triangles.push_back(t);
    for (std::size_t v = 0; v < vertices.size(); ++v)
        if (moves(static_cast<int>(v))) moving.push_back(static_cast<int>(v));
    const Corners corners(vertices.size(), triangles);
    const auto for_each_vertex = [&](const auto& body) {
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, moving.size(), 256), [&](const auto& range) {
            for (std::size_t m = range.begin(); m < range.end(); ++m) body(moving[m]);
        });
    };
    const auto for_each_triangle = [&](const auto& body) {
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, triangles.size(), 64), [&](const auto& range) {
            for (std::size_t t = range.begin(); t < range.end(); ++t) body(t);
        });
    };

    std::vector<Shares> shares(triangles.size());
    std::vector<char> bad(triangles.size());
    std::vector<Vec3> to = vertices;
    ThreadProbes probes(surface);
    for (int step = 0; step < steps; ++step) {
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, triangles.size(), 64), [&](const auto& range) {
            Surface::Probe& probe = probes.local();
            for (std::size_t t = range.begin(); t < range.end(); ++t)
                shares[t] = shares_of(vertices[triangles[t][0]], vertices[triangles[t][1]],
                                      vertices[triangles[t][2]], probe);
        });
        for_each_vertex([&](int v) {
            Mat3 quadric = Mat3::Zero();
            Vec3 pull = Vec3::Zero();
            double shortest2 = std::numeric_limits<double>::infinity();
            for (int e = corners.first[v]; e < corners.first[v + 1]; ++e) {
                const int t = corners.corner[e] / 3, k = corners.corner[e] % 3;
                const Shares& s = shares[t];
                quadric += s.weight[k] * s.normal * s.normal.transpose();
                pull += s.value[k] * s.normal;
                for (const int other : {triangles[t][(k + 1) % 3], triangles[t][(k + 2) % 3]})
                    shortest2 = std::min(shortest2, (vertices[other] - vertices[v]).squaredNorm());
            }
            to[v] = vertices[v];
            const double trace = quadric.trace();
            if (!(trace > 0.0)) return;
            quadric.diagonal().array() += damping * trace;
            Vec3 move = -kRelaxation * quadric.ldlt().solve(pull);
            const double length = move.norm(), limit = kLargestStep * std::sqrt(shortest2);
            if (length > limit) move *= limit / length;
            to[v] += move;
        });
        for (int pass = 0;; ++pass) {
            for_each_triangle([&](std::size_t t) {
                const auto& [i, j, k] = triangles[t];
                bad[t] = spoilt(vertices[i], vertices[j], vertices[k], to[i], to[j], to[k]);
            });
            if (std::find(bad.begin(), bad.end(), 1) == bad.end()) break;
            for_each_vertex([&](int v) {
                bool back = false;
                for (int e = corners.first[v]; e < corners.first[v + 1] && !back; ++e)
                    back = bad[corners.corner[e] / 3];
                if (back) to[v] = pass < kHalvings ? Vec3(0.5 * (vertices[v] + to[v])) : vertices[v];
            });
        }
        for (const int v : moving) vertices[v] = to[v];
    }
}

}  // namespace isotrack
