// The surface's values on facets, at the points that a fit and its flips go by.
#pragma once

#include <array>
#include <vector>

#include "isotrack/surface/surface.h"
#include "isotrack/types.h"
#include "meshing/corners.h"

namespace isotrack {

/// In floats, as the values of grids are, since there are many.
struct FacetValues {
    static constexpr int kSteps = 3;  ///< Per edge, of the barycentric lattice that the points are.
    static constexpr int kPoints = (kSteps + 1) * (kSteps + 2) / 2;

    Eigen::Vector3f normal = Eigen::Vector3f::Zero();  ///< Unit; zero without area.
    float area2 = 0.0f;                                ///< Twice the area.
    std::array<float, kPoints> value{};

    /// The barycentric coordinates of the points.
    static constexpr std::array<std::array<double, 3>, kPoints> kPlace = [] {
        std::array<std::array<double, 3>, kPoints> place{};
        int n = 0;
        for (int i = 0; i <= kSteps; ++i)
            for (int j = 0; i + j <= kSteps; ++j, ++n) {
                place[n][1] = i / double{kSteps};
                place[n][2] = j / double{kSteps};
                place[n][0] = (kSteps - i - j) / double{kSteps};
            }
        return place;
    }();

    FacetValues() = default;
    FacetValues(const Vec3& a, const Vec3& b, const Vec3& c, Surface::Probe& probe) : FacetValues(a, b, c) {
        for (int n = 0; n < kPoints; ++n) read(n, a, b, c, probe);
    }
    /// All values zero.
    FacetValues(const Vec3& a, const Vec3& b, const Vec3& c) {
        const Vec3 cross = (b - a).cross(c - a);
        const double length = cross.norm();
        if (!(length > 0.0)) return;
        area2 = static_cast<float>(length);
        normal = (cross / length).cast<float>();
    }
    void read(int n, const Vec3& a, const Vec3& b, const Vec3& c, Surface::Probe& probe) {
        value[n] = static_cast<float>(probe.value(place(n, a, b, c)));
    }
    static Vec3 place(int n, const Vec3& a, const Vec3& b, const Vec3& c) {
        const auto& [u, v, w] = kPlace[n];
        return u * a + v * b + w * c;
    }

    /// Twice the area times the mean square.
    double error() const {
        double sum = 0.0;
        for (const double x : value) sum += x * x;
        return area2 * sum / kPoints;
    }
};

/// Those of all triangles. What they have in common is read once: values at a vertex, and on an edge that is
/// in both directions. `corners`: of the triangles. The values are those of each alone, but for rounding.
/// Uses TBB inside; same result at any thread count.
std::vector<FacetValues> facet_values(const std::vector<Vec3>& vertices,
                                      const std::vector<Triangle>& triangles, const Corners& corners,
                                      const Surface& surface);

}  // namespace isotrack
