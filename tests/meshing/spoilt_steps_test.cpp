// Steps that would spoil triangles are shortened, and no others.
#include "meshing/spoilt_steps.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace isotrack {
namespace {

constexpr double kDegrees = 57.29577951308232;

double smallest_angle(const Vec3& a, const Vec3& b, const Vec3& c) {
    const auto at = [](const Vec3& p, const Vec3& q, const Vec3& r) {
        return kDegrees * std::atan2((q - p).cross(r - p).norm(), (q - p).dot(r - p));
    };
    return std::min({at(a, b, c), at(b, c, a), at(c, a, b)});
}

/// A flat sheet of right-angled triangles with uneven sides, and steps of up to a tenth of these.
struct Sheet {
    static constexpr int kSide = 40;
    std::vector<Vec3> from, to;
    std::vector<char> movable;
    std::vector<Triangle> triangles;

    explicit Sheet(unsigned seed) {
        std::mt19937 random(seed);
        std::uniform_real_distribution<double> unit(-1.0, 1.0);
        for (int y = 0; y < kSide; ++y)
            for (int x = 0; x < kSide; ++x) {
                from.emplace_back(x, 0.6 * y, 0.0);
                Vec3 step(unit(random), unit(random), unit(random));
                to.push_back(from.back() + 0.06 / std::max(1.0, step.norm()) * step);
                movable.push_back(random() % 5 != 0);
                if (!movable.back()) to.back() = from.back();
            }
        for (int y = 0; y + 1 < kSide; ++y)
            for (int x = 0; x + 1 < kSide; ++x) {
                const int v = y * kSide + x;
                triangles.push_back({v, v + 1, v + kSide});
                triangles.push_back({v + 1, v + kSide + 1, v + kSide});
            }
    }
    bool is_spoilt(const Triangle& t, const std::vector<Vec3>& now) const {
        const auto& [i, j, k] = t;
        const Vec3 before = (from[j] - from[i]).cross(from[k] - from[i]),
                   after = (now[j] - now[i]).cross(now[k] - now[i]);
        const double least = smallest_angle(now[i], now[j], now[k]);
        return !(before.dot(after) > 0.0) ||
               (least < 30.0 && least < smallest_angle(from[i], from[j], from[k]) - 1e-9);
    }
};

TEST(SpoiltSteps, LeaveNoTriangleSpoiltAndShortenThoseOfWholeTriangles) {
    int spoilt = 0, whole_steps = 0;
    for (unsigned seed = 1; seed <= 20; ++seed) {
        const Sheet sheet(seed);
        std::vector<Vec3> to = sheet.to;
        undo_spoilt_steps(sheet.from, to, sheet.triangles, sheet.movable);
        std::vector<char> may_be_shorter(to.size(), 0);  // in a triangle where all are
        for (const Triangle& t : sheet.triangles) {
            spoilt += sheet.is_spoilt(t, sheet.to);
            EXPECT_FALSE(sheet.is_spoilt(t, to));
            if (std::all_of(t.begin(), t.end(),
                            [&](int v) { return to[v] != sheet.to[v] || !sheet.movable[v]; }))
                for (const int v : t) may_be_shorter[v] = 1;
        }
        for (std::size_t v = 0; v < to.size(); ++v) {
            const Vec3 step = sheet.to[v] - sheet.from[v], made = to[v] - sheet.from[v];
            EXPECT_LE(made.norm(), step.norm() * (1.0 + 1e-12));
            EXPECT_LE(made.cross(step).norm(), 1e-12);  // along the step, or none
            EXPECT_TRUE(may_be_shorter[v] || to[v] == sheet.to[v]);
            whole_steps += sheet.movable[v] && to[v] == sheet.to[v];
        }
    }
    EXPECT_GT(spoilt, 100);
    EXPECT_GT(whole_steps, 1000);
}

}  // namespace
}  // namespace isotrack
