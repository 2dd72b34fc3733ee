#include "isotrack/sampling/sizing.h"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace isotrack {
namespace {

constexpr double kShare = 0.72;      // of the tolerance, aimed at by the largest error around a particle
constexpr double kGradation = 0.25;  // growth of the spacing per distance
constexpr int kGradationPasses = 3;
constexpr double kThicknessShare = 0.9;
constexpr double kMostStretch = 1.4;      // more saves nothing and makes sharper angles
constexpr double kCurvatureNoise = 0.15;  // of the curvature that the spacing is meant for

template <typename Body>
void for_each_particle(std::size_t n, const Body& body) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, n, 256), [&](const auto& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) body(i);
    });
}

/// Calls `body` with each neighbour of particle i that faces the same way.
template <typename Body>
void for_each_beside(const Particles& particles, const Adjacency& adjacency, std::size_t i,
                     const Body& body) {
    for (const int j : adjacency.of(i))
        if (particles.normal[i].dot(particles.normal[j]) > 0.0) body(j);
}

void limit_gradation(Particles& particles, const Adjacency& adjacency) {
    std::vector<double> next(particles.size());
    for (int pass = 0; pass < kGradationPasses; ++pass) {
        for_each_particle(particles.size(), [&](std::size_t i) {
            double h = particles.spacing[i];
            for_each_beside(particles, adjacency, i, [&](int j) {
                h = std::min(h, particles.spacing[j] +
                                    kGradation * (particles.position[j] - particles.position[i]).norm());
            });
            next[i] = h;
        });
        particles.spacing.swap(next);
    }
}

/// From the distances to the neighbours next to a particle; the wanted spacing where it has too few.
double actual_spacing(const Particles& particles, const Adjacency& adjacency, std::size_t i) {
    constexpr double kNextTo = 2.0;  // times the distance of the nearest
    double least = std::numeric_limits<double>::infinity(), sum = 0.0;
    int count = 0;
    for (const bool nearest : {true, false})
        for (const int j : adjacency.of(i)) {
            if (!(particles.normal[i].dot(particles.normal[j]) > 0.0)) continue;
            const double d = (particles.position[j] - particles.position[i]).norm();
            if (nearest) {
                least = std::min(least, d);
            } else if (d < kNextTo * least) {
                sum += d;
                ++count;
            }
        }
    return count > 2 ? sum / count : particles.spacing[i];
}

/// A symmetric map of the plane spanned by two unit vectors a and b: eigenvalues mean + off and mean - off.
struct PlaneMap {
    double mean, off;
    Vec3 major, minor;  // unit eigenvectors

    PlaneMap(double aa, double ab, double bb, const Vec3& a, const Vec3& b)
        : mean(0.5 * (aa + bb)), off(std::hypot(0.5 * (aa - bb), ab)) {
        const double angle = 0.5 * std::atan2(2.0 * ab, aa - bb);
        major = std::cos(angle) * a + std::sin(angle) * b;
        minor = std::cos(angle) * b - std::sin(angle) * a;
    }
};

/// The curvature around particle i, from steps in its tangent plane to changes of the normal, by least
/// squares over the neighbours; the principal curvatures without their signs.
Mat3 absolute_curvature(const Particles& particles, const Adjacency& adjacency, std::size_t i) {
    const Vec3 &p = particles.position[i], &n = particles.normal[i];
    const Vec3 a = n.unitOrthogonal(), b = n.cross(a);
    Mat3 squares = Mat3::Zero();
    Vec3 products = Vec3::Zero();
    for (const int j : adjacency.of(i)) {
        if (!(n.dot(particles.normal[j]) > 0.0)) continue;
        const Vec3 r = particles.position[j] - p, turn = particles.normal[j] - n;
        const double x = r.dot(a), y = r.dot(b), length2 = r.squaredNorm();
        if (!(length2 > 0.0)) continue;
        const Vec3 along_a(x, y, 0.0), along_b(0.0, x, y);  // times (aa, ab, bb)
        squares += (along_a * along_a.transpose() + along_b * along_b.transpose()) / length2;
        products += (turn.dot(a) * along_a + turn.dot(b) * along_b) / length2;
    }
    const Vec3 fitted = squares.ldlt().solve(products);
    if (!fitted.allFinite()) return Mat3::Zero();
    const PlaneMap map(fitted[0], fitted[1], fitted[2], a, b);
    return std::abs(map.mean + map.off) * map.major * map.major.transpose() +
           std::abs(map.mean - map.off) * map.minor * map.minor.transpose();
}

/// From the curvature around a particle, of which so much is noise.
Vec3 stretch_from(const Mat3& curvature, const Vec3& n, double noise) {
    const Vec3 a = n.unitOrthogonal(), b = n.cross(a);
    const PlaneMap map(a.dot(curvature * a), a.dot(curvature * b), b.dot(curvature * b), a, b);
    const double s = std::sqrt((map.mean + map.off + noise) / (map.mean - map.off + noise));
    return std::sqrt(std::clamp(s, 1.0, kMostStretch) - 1.0) * map.minor;
}

void update_stretch(Particles& particles, const Adjacency& adjacency, double tolerance) {
    std::vector<Mat3> curvature(particles.size());
    for_each_particle(particles.size(),
                      [&](std::size_t i) { curvature[i] = absolute_curvature(particles, adjacency, i); });
    for_each_particle(particles.size(), [&](std::size_t i) {
        Mat3 sum = curvature[i];
        int count = 1;
        for_each_beside(particles, adjacency, i, [&](int j) {
            sum += curvature[j];
            ++count;
        });
        // With this curvature a triangle of the wanted spacing has the tolerance for its error.
        const double bent = 6.0 * tolerance / (particles.spacing[i] * particles.spacing[i]);
        particles.stretch[i] = stretch_from(sum / count, particles.normal[i], kCurvatureNoise * bent);
    });
}

/// The spacing that a quarter of the particles are below.
double lower_quartile(std::vector<double> spacing) {
    const auto quartile = spacing.begin() + static_cast<std::ptrdiff_t>(spacing.size() / 4);
    std::nth_element(spacing.begin(), quartile, spacing.end());
    return *quartile;
}

/// What the error aimed at is multiplied by where its mean square counts.
class AimFactor {
public:
    AimFactor(const Particles& particles, double share_with_error)
        : wide_(lower_quartile(particles.spacing)),
          everywhere_(std::clamp(std::pow(share_with_error / kMost, 2.0), kLeast, 1.0)) {}
    /// For a particle of this spacing.
    double operator()(double h) const { return everywhere_ * std::min(1.0, std::sqrt(wide_ / h)); }

private:
    static constexpr double kMost = 0.9;  // of the particles have an error on smooth surfaces
    static constexpr double kLeast = 0.35;

    double wide_, everywhere_;
};

double bounded(double h, const SizingLimits& limits) {
    return std::clamp(h, limits.min_edge, limits.max_edge);
}

}  // namespace

double spacing_from_curvature(Surface::Probe& probe, const Vec3& p, const Vec3& n, double resolution,
                              const SizingLimits& limits) {
    // Curvature of the normal sections along two tangents, from normals two resolutions apart; the larger one
    // counts.
    const Vec3 a = n.unitOrthogonal(), b = n.cross(a);
    double kappa = 0.0;
    for (const Vec3& t : {a, b, Vec3((a + b).normalized()), Vec3((a - b).normalized())}) {
        const Vec3 forward = probe.normal(p + resolution * t), back = probe.normal(p - resolution * t);
        kappa = std::max(kappa, (forward - back).norm() / (2.0 * resolution));
    }
    // Error of an equilateral triangle on a sphere: kappa h^2 / 6.
    const double by_error = std::sqrt(6.0 * kShare * limits.tolerance / std::max(kappa, 1e-12));
    const double by_angle = std::max(limits.angle / std::max(kappa, 1e-12), limits.angle_floor);
    return bounded(std::min(by_error, by_angle), limits);
}

double share_with_error(const SizingEvidence& evidence, const SizingLimits& limits) {
    // Of the aim: triangles for the least of the aims below still have that.
    constexpr double kHardlyAny = 0.15;
    double known = 0.0, with_error = 0.0;
    for (const double e : evidence.error) {
        known += e >= 0.0;
        with_error += e > kHardlyAny * kShare * limits.tolerance;
    }
    return known > 0.0 ? with_error / known : 1.0;
}

double normal_deviation(const Particles& particles, const Adjacency& adjacency, std::size_t i) {
    double k2 = 0.0;
    for (const int j : adjacency.of(i)) {
        const double cosine = particles.normal[i].dot(particles.normal[j]);
        if (!(cosine > 0.0)) continue;
        const double r2 = (particles.position[j] - particles.position[i]).squaredNorm();
        if (r2 > 0.0) k2 = std::max(k2, (1.0 - cosine) / r2);
    }
    return std::sqrt(k2);
}

void update_spacing(Particles& particles, const Adjacency& adjacency, const SizingEvidence& evidence,
                    const SizingLimits& limits) {
    const std::size_t n = particles.size();
    if (n == 0) return;
    const double same = kShare * limits.tolerance;
    std::optional<AimFactor> factor;
    if (limits.mean_square_counts) factor.emplace(particles, share_with_error(evidence, limits));
    std::vector<double> log_k2(n);
    for_each_particle(n, [&](std::size_t i) {
        const double h = particles.spacing[i], e = evidence.error[i];
        const double aim = factor ? same * (*factor)(h) : same;
        if (e < 0.0)
            log_k2[i] = -2.0 * std::log(h);
        else
            log_k2[i] = std::log(std::clamp(e / aim, limits.thinning, 2.0) /
                                 (h * actual_spacing(particles, adjacency, i)));
    });
    std::vector<double> next(n);
    for_each_particle(n, [&](std::size_t i) {
        double sum = log_k2[i];
        int count = 1;
        for_each_beside(particles, adjacency, i, [&](int j) {
            sum += log_k2[j];
            ++count;
        });
        // The mean keeps noise out; where the tolerance is missed the particle's own need counts.
        const double mean = sum / count;
        const bool missed = evidence.error[i] > 0.95 * limits.tolerance;
        double h = std::exp(-0.5 * (missed ? std::max(mean, log_k2[i]) : mean));
        // 1 - cos t ~ t^2 / 2, so the curvature is sqrt(2) k_nd.
        const double kappa = std::sqrt(2.0) * normal_deviation(particles, adjacency, i);
        if (kappa > 0.0)
            h = std::min(h,
                         std::max({limits.angle * std::sqrt(1.0 + particles.stretch[i].squaredNorm()) / kappa,
                                   limits.angle_floor, 0.7 * particles.spacing[i]}));
        h = std::min(h, std::max(kThicknessShare * evidence.thickness[i], 0.7 * particles.spacing[i]));
        next[i] = bounded(h, limits);
    });
    particles.spacing.swap(next);
    limit_gradation(particles, adjacency);
    update_stretch(particles, adjacency, limits.tolerance);
}

}  // namespace isotrack
