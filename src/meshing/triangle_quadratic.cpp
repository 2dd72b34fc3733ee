#include "meshing/triangle_quadratic.h"

#include <Eigen/Cholesky>
#include <array>
#include <cassert>
#include <cmath>

namespace isotrack {
namespace {

using Terms = Eigen::Matrix<double, 6, 1>;

/// For lattices of one number of steps: by point, the terms of the function and how its value counts in each
/// coefficient.
struct LatticeFit {
    std::array<Terms, TriangleQuadratic::kMostPoints> terms, share;
    int points = 0;

    explicit LatticeFit(int steps) {
        Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
        for (int i = 0; i <= steps; ++i)
            for (int j = 0; i + j <= steps; ++j) {
                const double u = static_cast<double>(i) / steps, v = static_cast<double>(j) / steps;
                Terms& t = terms[points++];
                t << 1.0, u, v, u * u, u * v, v * v;
                normal += t * t.transpose();
            }
        const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> solver(normal);
        for (int p = 0; p < points; ++p) share[p] = solver.solve(terms[p]);
    }
};

const LatticeFit& lattice_fit(int steps) {
    static_assert(TriangleQuadratic::kFewestSteps == 3 && TriangleQuadratic::kMostSteps == 6);
    assert(steps >= TriangleQuadratic::kFewestSteps && steps <= TriangleQuadratic::kMostSteps);
    static const std::array<LatticeFit, 4> all{LatticeFit(3), LatticeFit(4), LatticeFit(5), LatticeFit(6)};
    return all[steps - TriangleQuadratic::kFewestSteps];
}

}  // namespace

TriangleQuadratic::TriangleQuadratic(const double* values, int steps) : k_(Terms::Zero()) {
    const LatticeFit& fit = lattice_fit(steps);
    for (int p = 0; p < fit.points; ++p) k_ += values[p] * fit.share[p];
    for (int p = 0; p < fit.points; ++p) {
        const double off = std::abs(k_.dot(fit.terms[p]) - values[p]);
        if (!(off <= residual_)) residual_ = off;
    }
}

TriangleQuadratic::Point TriangleQuadratic::peak(double sign) const {
    Point best{0.0, 0.0, k_[0]};
    const auto try_at = [&](double u, double v) {
        constexpr double kRounded = 1.0 + 1e-12;  // on the third edge
        // Where q is nowhere level, or everywhere, these are no numbers.
        if (!(u >= 0.0 && v >= 0.0 && u + v <= kRounded)) return;
        const double value = at(u, v);
        if (sign * value > sign * best.value) best = {u, v, value};
    };
    const double determinant = 4.0 * k_[3] * k_[5] - k_[4] * k_[4];
    try_at((k_[4] * k_[2] - 2.0 * k_[5] * k_[1]) / determinant,
           (k_[4] * k_[1] - 2.0 * k_[3] * k_[2]) / determinant);
    try_at(-0.5 * k_[1] / k_[3], 0.0);
    try_at(0.0, -0.5 * k_[2] / k_[5]);
    const double along = 0.5 * (k_[2] - k_[1] - k_[4] + 2.0 * k_[5]) / (k_[3] - k_[4] + k_[5]);
    try_at(along, 1.0 - along);
    return best;
}

}  // namespace isotrack
