// The quadratic function over a triangle that fits values at the points of a lattice best.
#pragma once

#include <Eigen/Core>

namespace isotrack {

/// q(u, v) = k . (1, u, v, u^2, u v, v^2) in the barycentric coordinates of the second and the third corner.
class TriangleQuadratic {
public:
    static constexpr int kFewestSteps = 3, kMostSteps = 6;
    static constexpr int kMostPoints = (kMostSteps + 1) * (kMostSteps + 2) / 2;

    /// The least squares fit to the values at (i, j) / steps, j <= steps - i first. `steps` from kFewestSteps
    /// to kMostSteps.
    TriangleQuadratic(const double* values, int steps);

    /// How far it is from the values at most; not a number where one of them is none.
    double residual() const { return residual_; }

    struct Point {
        double u, v, value;
    };
    /// Of the places inside the triangle and inside its edges where q is level, the one where `sign` q is
    /// largest; the first corner where that has more. The corners are among the values anyway.
    Point peak(double sign) const;

private:
    double at(double u, double v) const {
        return k_[0] + u * (k_[1] + u * k_[3] + v * k_[4]) + v * (k_[2] + v * k_[5]);
    }

    Eigen::Matrix<double, 6, 1> k_;
    double residual_ = 0.0;
};

}  // namespace isotrack
