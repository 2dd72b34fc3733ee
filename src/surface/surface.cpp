#include "isotrack/surface/surface.h"

#include <tbb/parallel_for.h>

#include <cmath>
#include <utility>

#include "surface/lattice_scan.h"

namespace isotrack {
namespace {

constexpr int kMaxTrials = 40;           // a good start needs 3 to 5
constexpr double kFirstDamping = 1e-3;   // the paper starts at 1, which only halves the first step
constexpr double kLargestDamping = 1e4;  // steps are then too short to matter
constexpr double kLeastGradient = 1e-3;  // of a distance's 1: below it nothing is known
constexpr double kOnNode = 1e-6;         // lattice units

/// The nodes of the default lattice, which reaches a node beyond the box on each side.
Eigen::Array3i nodes_across(const Box& box, double h) {
    return ((box.sizes() / h).array().ceil()).cast<int>() + 3;
}

}  // namespace

Surface::Probe::CellValues Surface::Probe::cell_values(const Vec3& low, const Eigen::Affine3d& lattice) {
    CellValues result;
    for (int k = 0; k < 8; ++k) result[k] = value(lattice * (low + Vec3(k & 1, k >> 1 & 1, k >> 2)));
    return result;
}

std::optional<Vec3> Surface::Probe::project(const Vec3& start) {
    // f, p and lambda as in the paper's algorithm 4.
    Vec3 p = start;
    Sample f = sample(p);
    double lambda = kFirstDamping;
    for (int trial = 0; trial < kMaxTrials && std::abs(f.value) > epsilon_; ++trial) {
        const double g2 = f.gradient.squaredNorm();
        if (!(g2 > kLeastGradient * kLeastGradient)) return std::nullopt;
        Vec3 step = -f.value / ((1.0 + lambda) * g2) * f.gradient;
        const double length = step.norm();
        if (length > max_step_) step *= max_step_ / length;
        const Sample next = sample(p + step);
        if (std::abs(next.value) < std::abs(f.value)) {
            p += step;
            f = next;
            lambda /= 10.0;
        } else {
            lambda *= 10.0;
            if (lambda > kLargestDamping) return std::nullopt;
        }
    }
    if (!(std::abs(f.value) <= epsilon_)) return std::nullopt;
    projected_ = p;
    gradient_ = f.gradient;
    return p;
}

Vec3 Surface::Probe::normal(const Vec3& p) {
    const Vec3 gradient = p == projected_ ? gradient_ : sample(p).gradient;
    const double length = gradient.norm();
    if (!(length > 0.0)) return Vec3::Zero();
    return gradient / length;
}

Eigen::Affine3d Surface::lattice() const {
    const Box box = bounds();
    Eigen::Affine3d result = Eigen::Affine3d::Identity();
    if (box.isEmpty()) return result;
    const double h = resolution();
    const Eigen::Array3i n = nodes_across(box, h);
    result.translate(box.center() - 0.5 * h * (n - 1).cast<double>().matrix()).scale(h);
    return result;
}

Surface::CrossingSequence Surface::crossing_sequence(double) const {
    std::vector<Crossing> result;
    const Box box = bounds();
    if (box.isEmpty()) return {};
    const Eigen::Affine3d from_lattice = lattice();
    scan_lattice(*probe(), from_lattice, Vec3::Zero(), nodes_across(box, resolution()),
                 [&](const Vec3& node, int axis, double fraction, bool outward) {
                     result.push_back({from_lattice * (node + fraction * Vec3::Unit(axis)),
                                       (outward ? 1.0f : -1.0f) * Eigen::Vector3f::Unit(axis)});
                 });
    return CrossingSequence(std::move(result));
}

std::vector<Surface::Crossing> Surface::crossings(double apart) const {
    const CrossingSequence sequence = crossing_sequence(apart);
    std::vector<Crossing> result(sequence.size);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, result.size(), 4096), [&](const auto& range) {
        sequence.write(range.begin(), range.end(), &result[range.begin()]);
    });
    return result;
}

std::vector<Eigen::Vector3i> Surface::upright_crossings() const {
    const Eigen::Affine3d from_lattice = lattice(), to_lattice = from_lattice.inverse();
    const auto access = probe();
    std::vector<Eigen::Vector3i> result;
    for (const auto& c : crossings()) {
        const Vec3 way = to_lattice.linear() * c.outward.cast<double>(), p = to_lattice * c.point;
        if (std::abs(way.z()) < 0.5 * way.norm()) continue;
        const Vec3 nearest = p.array().round();
        // On a node rounding decides which of its edges is crossed.
        const double beyond = p.z() - nearest.z();
        const auto is_inside = [&] { return access->value(from_lattice * nearest) < 0.0; };
        const bool up = std::abs(beyond) > kOnNode ? beyond > 0.0 : is_inside() == (way.z() > 0.0);
        result.push_back(nearest.cast<int>() - (up ? 0 : 1) * Eigen::Vector3i::UnitZ());
    }
    return result;
}

}  // namespace isotrack
