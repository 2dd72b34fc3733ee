#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <utility>

#include "meshing/blunting.h"
#include "meshing/corners.h"
#include "meshing/sharpness.h"
#include "surface/float_precision.h"

namespace isotrack {
namespace {

constexpr int kWays = 8;                              // that are tried from each place
constexpr double kFirstStep = 0.3, kLastStep = 0.02;  // of the mean edge
constexpr int kHalvings = 2;                          // of a move that leaves the tolerance

/// The triangles around a vertex.
struct Star {
    std::vector<int> triangle;
    std::vector<std::array<Vec3, 2>> opposite;  // edge of each
    double mean_edge = 0.0;

    Star(int v, const BluntedMesh& mesh) {
        const auto& [points, triangles, corners] = std::tie(mesh.points, mesh.triangles, mesh.corners);
        for (int e = corners.first[v]; e < corners.first[v + 1]; ++e) {
            const int t = corners.corner[e] / 3, k = corners.corner[e] % 3;
            triangle.push_back(t);
            opposite.push_back({points[triangles[t][(k + 1) % 3]], points[triangles[t][(k + 2) % 3]]});
            mean_edge += (opposite.back()[0] - points[v]).norm();
        }
        mean_edge /= static_cast<double>(triangle.size());
    }
    /// The cotangent of the smallest angle with the vertex at x.
    double sharpness_at(const Vec3& x) const {
        double result = 0.0;
        for (const auto& [a, b] : opposite) result = std::max(result, sharpness(x, a, b));
        return result;
    }
};

/// Where in the tangent plane the star is bluntest, by a pattern search.
Vec3 bluntest_place(const Star& star, const Vec3& from, const Vec3& normal) {
    const Vec3 u = normal.unitOrthogonal(), v = normal.cross(u);
    Vec3 best = from;
    double least = star.sharpness_at(from);
    for (double step = kFirstStep; step >= kLastStep;) {
        const Vec3 centre = best;
        for (int way = 0; way < kWays; ++way) {
            const double angle = way * (2.0 * M_PI / kWays);
            const Vec3 x = centre + step * star.mean_edge * (std::cos(angle) * u + std::sin(angle) * v);
            if (const double s = star.sharpness_at(x); s < least) {
                least = s;
                best = x;
            }
        }
        if (best == centre) step *= 0.5;
    }
    return best;
}

}  // namespace

std::optional<Blunting> nudge(BluntedMesh& mesh, int triangle) {
    auto& points = mesh.points;
    struct Move {
        int vertex;
        Star star;
        Vec3 to;
        double before, after;  // cotangents
    };
    std::vector<Move> moves;
    for (const int v : mesh.triangles[triangle]) {
        if (!mesh.movable[v] || mesh.touched[v]) continue;
        Star star(v, mesh);
        const Vec3 normal = mesh.probe.normal(points[v]);
        if (normal == Vec3::Zero()) continue;
        const Vec3 to = bluntest_place(star, points[v], normal);
        const double before = star.sharpness_at(points[v]), after = star.sharpness_at(to);
        if (after < kBluntGain * before) moves.push_back({v, std::move(star), to, before, after});
    }
    std::sort(moves.begin(), moves.end(), [](const Move& a, const Move& b) { return a.after < b.after; });
    for (const auto& [v, star, goal, before, after] : moves) {
        const Vec3 from = points[v];
        const double height = mesh.probe.value(from);
        std::vector<Triangle> around;
        for (const int t : star.triangle) around.push_back(mesh.triangles[t]);
        const double facing = mesh.facing(around);
        Vec3 way = goal - from;
        for (int halving = 0; halving <= kHalvings; ++halving, way *= 0.5) {
            const auto on_surface = mesh.probe.project(from + way);
            if (!on_surface) continue;
            const Vec3 to = to_float_precision(*on_surface + height * mesh.probe.normal(*on_surface));
            if (!(star.sharpness_at(to) < kBluntGain * before)) continue;
            points[v] = to;
            if (mesh.may_have(around, facing)) {
                for (const Triangle& t : around)
                    for (const int w : t) mesh.touched[w] = 1;
                return Blunting{star.triangle, around, v, from};
            }
            points[v] = from;
        }
    }
    return std::nullopt;
}

}  // namespace isotrack
