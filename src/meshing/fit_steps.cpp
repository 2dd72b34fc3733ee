#include "meshing/fit_steps.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "meshing/spoilt_steps.h"
#include "parallel_for_each.h"
#include "surface/thread_probes.h"

namespace isotrack {
namespace {

// The points of the closed Newton-Cotes rule of degree 3 over a triangle, whose weights 54, 9 and 4 are exact
// for the parabola that a curved surface makes under a facet. Corners and edges count more here, where a
// fitted mesh is farthest from its surface: that lowers the largest error. Much more would cost the right
// volume.
constexpr std::array<double, FacetValues::kPoints> kWeight = [] {
    constexpr double kByZeros[3] = {54.0, 12.0, 7.0};  // in the middle, on an edge, in a corner
    std::array<double, FacetValues::kPoints> weight{};
    for (int n = 0; n < FacetValues::kPoints; ++n) {
        int zeros = 0;
        for (const double u : FacetValues::kPlace[n]) zeros += u == 0.0;
        weight[n] = kByZeros[zeros];
    }
    return weight;
}();

/// Moments of these weights: of two corners' barycentric coordinates, and of one's.
struct Moments {
    double same = 0.0, different = 0.0, one = 0.0;
};
constexpr Moments kMoments = [] {
    Moments m;
    for (int n = 0; n < FacetValues::kPoints; ++n) {
        const auto& u = FacetValues::kPlace[n];
        m.same += kWeight[n] * u[0] * u[0];
        m.different += kWeight[n] * u[0] * u[1];
        m.one += kWeight[n] * u[0];
    }
    return m;
}();

constexpr double kLargestStep = 0.1;  // of the shortest edge around a vertex
constexpr double kSmooth = 0.9;  // cosine between the facets around a vertex and their mean: less is a crease
constexpr std::size_t kVertexGrain = 256, kTriangleGrain = 64;

/// How long steps are, and how much of the last one is made again: Chebyshev's semi-iteration [Golub, Varga
/// 1961]. A vertex that solves a quadric of its own leaves out that its neighbours move as well. What it
/// solves for are the row sums of the normal equations: times the inverse of these, the equations have
/// eigenvalues from kLeast, those of a triangle's corners against each other, to 1, of all alike.
class Chebyshev {
public:
    double length() const { return length_; }
    double again() const { return again_; }
    void next() {
        const double share = (is_first_ ? 0.5 : 0.25) * kHalf * kHalf * length_;
        is_first_ = false;
        const double length = 1.0 / (kMiddle - share);
        again_ = share * length;
        length_ = length;
    }

private:
    static constexpr double kLeast = (kMoments.same - kMoments.different) / kMoments.one;
    static constexpr double kMiddle = 0.5 * (1.0 + kLeast), kHalf = 0.5 * (1.0 - kLeast);
    double length_ = 1.0 / kMiddle, again_ = 0.0;
    bool is_first_ = true;
};

/// A triangle's share in the normal equations of its corners.
struct Share {
    Eigen::Vector3f normal;
    float area2;
    std::array<double, 3> pull{};  ///< The integrals of the value times a corner's barycentric coordinate.

    explicit Share(const FacetValues& facet) : normal(facet.normal), area2(facet.area2) {
        for (int n = 0; n < FacetValues::kPoints; ++n)
            for (int k = 0; k < 3; ++k)
                pull[k] += area2 * kWeight[n] * FacetValues::kPlace[n][k] * facet.value[n];
    }
    /// After its corners moved along the normal by `way`.
    void move(const std::array<double, 3>& way) {
        const double sum = way[0] + way[1] + way[2];
        for (int k = 0; k < 3; ++k)
            pull[k] += area2 * (kMoments.same * way[k] + kMoments.different * (sum - way[k]));
    }
};

}  // namespace

void fit_steps(std::vector<Vec3>& vertices, const std::vector<Triangle>& triangles, const Corners& corners,
               std::vector<FacetValues> facets, const Surface& surface, int steps,
               const std::vector<char>& movable, double damping) {
    std::vector<Share> shares(facets.begin(), facets.end());
    facets = std::vector<FacetValues>();  // there are many
    std::vector<int> moving;
    for (std::size_t v = 0; v < vertices.size(); ++v)
        if (movable[v]) moving.push_back(static_cast<int>(v));

    std::vector<Eigen::Matrix3f> inverse(moving.size());  // of the quadrics, zero without one; there are many
    std::vector<char> creased(vertices.size(), 0);
    parallel_for_each(moving.size(), kVertexGrain, [&](std::size_t m) {
        const int v = moving[m];
        Mat3 quadric = Mat3::Zero();
        Vec3 sum = Vec3::Zero();
        for (int e = corners.first[v]; e < corners.first[v + 1]; ++e) {
            const Share& s = shares[corners.corner[e] / 3];
            const Vec3 normal = s.normal.cast<double>();
            quadric += s.area2 * kMoments.one * normal * normal.transpose();
            sum += normal;
        }
        for (int e = corners.first[v]; e < corners.first[v + 1]; ++e)
            if (!(shares[corners.corner[e] / 3].normal.cast<double>().dot(sum) > kSmooth * sum.norm()))
                creased[v] = 1;
        const double trace = quadric.trace();
        quadric.diagonal().array() += damping * trace;
        inverse[m].setZero();
        if (trace > 0.0) inverse[m] = Mat3(quadric.inverse()).cast<float>();
    });
    std::vector<Vec3> to = vertices;
    std::vector<Eigen::Vector3f> last(moving.size(), Eigen::Vector3f::Zero());  // steps
    ThreadProbes probes(surface);
    Chebyshev pace;
    for (int step = 0; step < steps; ++step, pace.next()) {
        parallel_for_each(moving.size(), kVertexGrain, [&](std::size_t m) {
            const int v = moving[m];
            Vec3 pull = Vec3::Zero();
            double shortest2 = std::numeric_limits<double>::infinity();
            for (int e = corners.first[v]; e < corners.first[v + 1]; ++e) {
                const int t = corners.corner[e] / 3, k = corners.corner[e] % 3;
                pull += shares[t].pull[k] * shares[t].normal.cast<double>();
                for (const int other : {triangles[t][(k + 1) % 3], triangles[t][(k + 2) % 3]})
                    shortest2 = std::min(shortest2, (vertices[other] - vertices[v]).squaredNorm());
            }
            Vec3 move =
                pace.again() * last[m].cast<double>() - pace.length() * (inverse[m].cast<double>() * pull);
            const double length = move.norm(), limit = kLargestStep * std::sqrt(shortest2);
            if (length > limit) move *= limit / length;
            to[v] = vertices[v] + move;
        });
        undo_spoilt_steps(vertices, to, triangles, movable);
        if (step + 1 < steps)
            parallel_for_each(triangles.size(), kTriangleGrain, [&](std::size_t t) {
                const auto& [i, j, k] = triangles[t];
                const auto way = [&](int v) {
                    return shares[t].normal.cast<double>().dot(to[v] - vertices[v]);
                };
                if (creased[i] || creased[j] || creased[k])
                    shares[t] = Share({to[i], to[j], to[k], probes.local()});
                else
                    shares[t].move({way(i), way(j), way(k)});
            });
        for (std::size_t m = 0; m < moving.size(); ++m) {
            const int v = moving[m];
            last[m] = (to[v] - vertices[v]).cast<float>();
            vertices[v] = to[v];
        }
    }
}

}  // namespace isotrack
