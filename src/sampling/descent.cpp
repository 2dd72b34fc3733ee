#include "sampling/descent.h"

#include <algorithm>
#include <cmath>

namespace isotrack {
namespace {

constexpr int kTrials = 5;  // of lambda within one step
constexpr int kMostNeighbours = 64;
constexpr double kLeastInPlane = 0.5;  // of a way to go: more upright than that there is none

struct Neighbour {
    Vec3 position;
    Metric metric;  // its own

    double square(const Metric& other, const Vec3& r) const {
        return 0.5 * (other.square(r) + metric.square(r));
    }
};

/// The neighbours of particle i within 2 sigma, and sigma^2, in the metric.
struct Surroundings {
    Neighbour list[kMostNeighbours];
    int count = 0;
    Metric metric;
    double sigma2 = 0.0;
    double nearest = 0.0;  // world units

    Surroundings(const Particles& particles, const std::vector<Metric>& metrics, Adjacency::Range neighbours,
                 int i)
        : metric(metrics[i]) {
        const Vec3& p = particles.position[i];
        const Vec3& n = particles.normal[i];
        double least = 1e300, least_world = 1e300;
        for (const int j : neighbours) {
            if (!(n.dot(particles.normal[j]) > 0.0) || count == kMostNeighbours) continue;
            const Vec3 r = particles.position[j] - p;
            list[count] = {particles.position[j], metrics[j]};
            least = std::min(least, list[count].square(metric, r));
            least_world = std::min(least_world, r.squaredNorm());
            ++count;
        }
        sigma2 = 0.5 * least;
        nearest = std::sqrt(least_world);
        int kept = 0;
        for (int a = 0; a < count; ++a)
            if (list[a].square(metric, list[a].position - p) < 4.0 * sigma2) list[kept++] = list[a];
        count = kept;
    }

    double energy(const Vec3& p) const {
        double e = 0.0;
        for (int a = 0; a < count; ++a) e += std::exp(-list[a].square(metric, list[a].position - p) / sigma2);
        return e;
    }
};

/// An orthonormal pair perpendicular to the unit vector n [Duff et al. 2017].
void tangent_frame(const Vec3& n, Vec3& a, Vec3& b) {
    const double sign = std::copysign(1.0, n.z());
    const double u = -1.0 / (sign + n.z()), v = n.x() * n.y() * u;
    a = Vec3(1.0 + sign * n.x() * n.x() * u, sign * v, -sign * n.x());
    b = Vec3(v, sign + n.y() * n.y() * u, -n.y());
}

}  // namespace

DescentStep descend(Particles& particles, const std::vector<Metric>& metrics, Adjacency::Range neighbours,
                    int i, double& lambda, Surface::Probe& probe, const Vec3* along) {
    const Surroundings near(particles, metrics, neighbours, i);
    if (near.count == 0 || !(near.sigma2 > 0.0)) return {};
    const double sigma = std::sqrt(near.sigma2);
    const Vec3 p = particles.position[i];
    const Vec3 n = particles.normal[i];
    Vec3 a, b;
    tangent_frame(n, a, b);
    if (along) {
        const Vec3 in_plane = *along - along->dot(n) * n;
        if (!(in_plane.norm() > kLeastInPlane)) return {0.0, sigma};
        a = in_plane.normalized();
        b = n.cross(a);
    }

    // Gradient and Hessian of the tangential energy F_i (appendix 1, with the sign of the gradient put right:
    // it points away from where the energy falls, towards the neighbours).
    double g1 = 0.0, g2 = 0.0, h11 = 0.0, h12 = 0.0, h22 = 0.0;
    for (int j = 0; j < near.count; ++j) {
        const Vec3 r = near.list[j].position - p, s = r - r.dot(n) * n;
        const Vec3 ms = (near.metric.apply(s) + near.list[j].metric.apply(s)) / (2.0 * near.sigma2);
        const double s1 = ms.dot(a), s2 = ms.dot(b), q = ms.dot(s), e = std::exp(-q);
        g1 += 2.0 * e * s1;
        g2 += 2.0 * e * s2;
        if (q > 0.0) {
            const double c = e * (4.0 * q - 2.0) / q;
            h11 += c * s1 * s1;
            h12 += c * s1 * s2;
            h22 += c * s2 * s2;
        }
    }
    if (along) {
        g2 = h12 = 0.0;
        h22 = 1.0;
    }
    const double energy = near.energy(p);
    for (int trial = 0; trial < kTrials; ++trial) {
        const double d11 = h11 * (1.0 + lambda), d22 = h22 * (1.0 + lambda), det = d11 * d22 - h12 * h12;
        Vec3 step;
        if (det > 0.0 && d11 > 0.0) {
            step = -((d22 * g1 - h12 * g2) * a + (d11 * g2 - h12 * g1) * b) / det;
        } else {
            // A neighbour nearer than sigma / sqrt(2) makes the Hessian indefinite: go down the gradient.
            const double length = std::hypot(g1, g2);
            if (!(length > 0.0)) return {0.0, sigma};
            step = -(0.5 * near.nearest / (length * (1.0 + lambda))) * (g1 * a + g2 * b);
        }
        const double length = step.norm();
        if (!std::isfinite(length)) return {0.0, sigma};
        if (length > 0.5 * near.nearest) step *= 0.5 * near.nearest / length;
        const auto q = probe.project(p + step);
        if (q && near.energy(*q) < energy) {
            const Vec3 normal = probe.normal(*q);
            if (normal.dot(n) > 0.0) {
                particles.position[i] = *q;
                particles.normal[i] = normal;
                lambda = std::max(lambda / 10.0, 1e-6);
                return {(*q - p).norm() / (particles.spacing[i] * sigma), sigma};
            }
        }
        // Below this step nothing worth a projection is left to gain.
        if (length < 0.2 * kRestThreshold * near.nearest) return {0.0, sigma};
        lambda *= 10.0;
    }
    return {0.0, sigma};
}

}  // namespace isotrack
