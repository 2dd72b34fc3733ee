#include "surface/surface_near.h"

namespace isotrack {
namespace {

constexpr int kSteps = 4;  // along a segment: what is thinner than that is stepped over
constexpr int kHalvings = 24;

/// The length from p along a unit vector after which the value has another sign; `most` if there is none.
double length_to_other_side(Surface::Probe& probe, const Vec3& p, bool inside, const Vec3& way, double most) {
    const auto is_other = [&](double length) { return (probe.value(p + length * way) < 0.0) != inside; };
    for (int step = 1; step <= kSteps; ++step) {
        double from = most * (step - 1) / kSteps, to = most * step / kSteps;
        if (!is_other(to)) continue;
        for (int halving = 0; halving < kHalvings; ++halving) {
            const double middle = 0.5 * (from + to);
            (is_other(middle) ? to : from) = middle;
        }
        return to;
    }
    return most;
}

}  // namespace

std::optional<Vec3> surface_near(Surface::Probe& probe, const Vec3& p, double distance) {
    if (const auto projected = probe.project(p); projected && (*projected - p).norm() < distance)
        return projected;
    const bool inside = probe.value(p) < 0.0;
    double least = distance;
    std::optional<Vec3> result;
    for (int x = -1; x <= 1; ++x)
        for (int y = -1; y <= 1; ++y)
            for (int z = -1; z <= 1; ++z) {
                if (x == 0 && y == 0 && z == 0) continue;
                const Vec3 way = Vec3(x, y, z).normalized();
                const double length = length_to_other_side(probe, p, inside, way, least);
                if (!(length < least)) continue;
                least = length;
                result = p + length * way;
            }
    return result;
}

}  // namespace isotrack
