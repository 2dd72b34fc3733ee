#include "meshing/stands_for.h"

#include <algorithm>

namespace isotrack {
namespace {

constexpr double kOwn = 1.03;  // of the tolerance: what is that near is of a triangle

}  // namespace

bool stand_for_same(const CrossingGrid& points, const std::vector<FacingTriangle>& before, const Box& box,
                    const std::vector<FacingTriangle>& after, const std::vector<FacingTriangle>& beside,
                    double tolerance) {
    const double own2 = kOwn * tolerance * kOwn * tolerance, tolerance2 = tolerance * tolerance;
    const Vec3 reach = Vec3::Constant(kOwn * tolerance);
    bool all = true;
    const auto check = [&](const Surface::Crossing& crossing) {
        double least = own2;
        bool own = false;
        for (const FacingTriangle& t : before) {
            const double d2 = t.squared_distance(crossing, least);
            if (d2 > least) continue;
            least = d2;
            own = true;
        }
        if (!own) return;
        const double limit = std::max(least, tolerance2);
        const auto reaches = [&](const FacingTriangle& t) {
            return t.squared_distance(crossing, limit) <= limit;
        };
        all = std::any_of(after.begin(), after.end(), reaches) ||
              std::any_of(beside.begin(), beside.end(), reaches);
    };
    points.for_each_in(Box(box.min() - reach, box.max() + reach), [&](std::size_t c) {
        if (all) check(points[c]);
    });
    return all;
}

}  // namespace isotrack
