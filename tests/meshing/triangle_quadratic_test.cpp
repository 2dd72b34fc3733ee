// Fits whose function is known, and peaks against a fine lattice.
#include "meshing/triangle_quadratic.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

namespace isotrack {
namespace {

using Coefficients = std::array<double, 6>;

double value_of(const Coefficients& k, double u, double v) {
    return k[0] + k[1] * u + k[2] * v + k[3] * u * u + k[4] * u * v + k[5] * v * v;
}

template <typename Value>
TriangleQuadratic fit(const Value& value, int steps) {
    std::vector<double> values;
    for (int i = 0; i <= steps; ++i)
        for (int j = 0; i + j <= steps; ++j)
            values.push_back(value(static_cast<double>(i) / steps, static_cast<double>(j) / steps));
    return {values.data(), steps};
}

TEST(TriangleQuadratic, HasItsPeakWhereAFineLatticeFindsIt) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> any(-1.0, 1.0);
    constexpr int kFine = 200;
    for (int trial = 0; trial < 200; ++trial) {
        Coefficients k;
        for (double& c : k) c = any(random);
        const auto value = [&](double u, double v) { return value_of(k, u, v); };
        const TriangleQuadratic quadratic = fit(value, 3 + trial % 4);
        EXPECT_LT(quadratic.residual(), 1e-12);
        for (const double sign : {1.0, -1.0}) {
            double most = -1e300;
            for (int i = 0; i <= kFine; ++i)
                for (int j = 0; i + j <= kFine; ++j)
                    most = std::max(most, sign * value(1.0 * i / kFine, 1.0 * j / kFine));
            const auto peak = quadratic.peak(sign);
            EXPECT_NEAR(peak.value, value(peak.u, peak.v), 1e-12);
            const double at_corner = std::max({sign * value(0, 0), sign * value(1, 0), sign * value(0, 1)});
            EXPECT_GE(std::max(sign * peak.value, at_corner), most - 1e-12);
            EXPECT_TRUE(peak.u >= 0.0 && peak.v >= 0.0 && peak.u + peak.v <= 1.0 + 1e-12);
        }
    }
}

TEST(TriangleQuadratic, HasAPeakWhereTheFunctionIsFlat) {
    const TriangleQuadratic quadratic = fit([](double, double) { return 0.5; }, 3);
    EXPECT_NEAR(quadratic.peak(1.0).value, 0.5, 1e-12);
    EXPECT_NEAR(quadratic.peak(-1.0).value, 0.5, 1e-12);
}

TEST(TriangleQuadratic, IsNotCloseToWhatIsNotANumber) {
    const auto one = [](double u, double v) { return u == 1.0 ? std::nan("") : v; };
    EXPECT_FALSE(fit(one, 3).residual() < 1e300);
}

TEST(TriangleQuadratic, TellsHowFarItIsFromWhatIsNoQuadratic) {
    const auto ridge = [](double u, double) { return 1.0 - 2.0 * std::abs(u - 0.4); };
    for (int steps = TriangleQuadratic::kFewestSteps; steps <= TriangleQuadratic::kMostSteps; ++steps)
        EXPECT_GT(fit(ridge, steps).residual(), 0.05);
}

}  // namespace
}  // namespace isotrack
