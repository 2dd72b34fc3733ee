#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include "isotrack/meshing/self_intersections.h"
#include "meshing/blunting.h"
#include "meshing/corners.h"
#include "meshing/sharpness.h"
#include "surface/float_precision.h"
#include "ways_around.h"

namespace isotrack {
namespace {

constexpr double kFirstStep = 0.3, kLastStep = 0.02;  // of the mean edge
constexpr int kHalvings = 2;                          // of a move that leaves the tolerance
constexpr double kFitted = 0.01;                      // tolerances: what is that far off may be farther off
constexpr double kLift = 0.25;                        // tolerances: so far up or down
constexpr double kShort = 0.5;  // details: longest edge of what is looked at only where there is little of it

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
    /// The cotangent of the smallest angle with the vertex at x; anything above `enough` where it is.
    double sharpness_at(const Vec3& x, double enough = std::numeric_limits<double>::infinity()) const {
        double result = 0.0;
        for (std::size_t i = 0; i < opposite.size() && result <= enough; ++i)
            result = std::max(result, sharpness(x, opposite[i][0], opposite[i][1]));
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
        for (const auto& [cosine, sine] : ways_around()) {
            const Vec3 x = centre + step * star.mean_edge * (cosine * u + sine * v);
            if (const double s = star.sharpness_at(x, least); s < least) {
                least = s;
                best = x;
            }
        }
        if (best == centre) step *= 0.5;
    }
    return best;
}

/// Marks the vertices of the triangles around v, which moved from there, and says what was done.
Blunting moved(BluntedMesh& mesh, const Star& star, const std::vector<Triangle>& around, int v,
               const Vec3& from) {
    for (const Triangle& t : around)
        for (const int w : t) mesh.touched[w] = 1;
    return {star.triangle, around, v, from};
}

std::vector<Triangle> triangles_of(const Star& star, const BluntedMesh& mesh) {
    std::vector<Triangle> result;
    for (const int t : star.triangle) result.push_back(mesh.triangles[t]);
    return result;
}

double longest_edge(const BluntedMesh& mesh, int triangle) {
    const auto& [a, b, c] = mesh.triangles[triangle];
    const auto& at = mesh.points;
    return std::sqrt(std::max(
        {(at[b] - at[a]).squaredNorm(), (at[c] - at[b]).squaredNorm(), (at[a] - at[c]).squaredNorm()}));
}

/// For what nothing cheaper helps: a pattern search in space over the places that the mesh may have, for each
/// corner; the bluntest counts.
std::optional<Blunting> search(BluntedMesh& mesh, int triangle) {
    auto& points = mesh.points;
    int vertex = -1;
    Vec3 place;
    double bluntest = std::numeric_limits<double>::infinity();
    for (const int v : mesh.triangles[triangle]) {
        if (!mesh.movable[v] || mesh.touched[v]) continue;
        const Star star(v, mesh);
        const std::vector<Triangle> around = triangles_of(star, mesh);
        const Replaced before = mesh.replaced(star.triangle);
        const Vec3 from = points[v], reach = Vec3::Constant(star.mean_edge);
        std::optional<std::vector<Triangle>> others;  // nearby
        const auto crosses_others = [&] {
            if (!others)
                others = mesh.near(Box(before.box.min() - reach, before.box.max() + reach), star.triangle);
            return any_cross(points, around, *others);
        };
        Vec3 best = from;
        double least = star.sharpness_at(from);
        const double enough = worth(least);
        for (double step = kFirstStep; step >= kLastStep;) {
            std::vector<std::pair<double, Vec3>> blunter;
            for (int x = -1; x <= 1; ++x)
                for (int y = -1; y <= 1; ++y)
                    for (int z = -1; z <= 1; ++z) {
                        const Vec3 there = to_float_precision(best + step * star.mean_edge * Vec3(x, y, z));
                        if (const double s = star.sharpness_at(there, least); s < least)
                            blunter.emplace_back(s, there);
                    }
            std::sort(blunter.begin(), blunter.end(),
                      [](const auto& p, const auto& q) { return p.first < q.first; });
            const auto found = std::find_if(blunter.begin(), blunter.end(), [&](const auto& candidate) {
                points[v] = candidate.second;
                return mesh.may_have(around, before) && !crosses_others();
            });
            if (found == blunter.end())
                step *= 0.5;
            else
                std::tie(least, best) = *found;
        }
        points[v] = from;
        if (!(least < enough) || !(least < bluntest)) continue;
        bluntest = least;
        vertex = v;
        place = best;
    }
    if (vertex < 0) return std::nullopt;
    const Star star(vertex, mesh);
    const Vec3 from = points[vertex];
    points[vertex] = place;
    return moved(mesh, star, triangles_of(star, mesh), vertex, from);
}

}  // namespace

std::optional<Blunting> nudge(BluntedMesh& mesh, int triangle, double sharpness) {
    if (longest_edge(mesh, triangle) < kShort * mesh.detail && mesh.short_ones_left-- <= 0)
        return std::nullopt;
    auto& points = mesh.points;
    struct Move {
        int vertex;
        Star star;
        Vec3 to;
        double before, after;  // cotangents
    };
    std::vector<Move> moves;
    for (const int v : mesh.triangles[triangle]) {
        if (!mesh.movable[v] || mesh.fixed[v] || mesh.touched[v]) continue;
        Star star(v, mesh);
        const Vec3 normal = mesh.probe.normal(points[v]);
        if (normal == Vec3::Zero()) continue;
        const Vec3 to = bluntest_place(star, points[v], normal);
        const double before = star.sharpness_at(points[v]), after = star.sharpness_at(to);
        if (after < worth(before)) moves.push_back({v, std::move(star), to, before, after});
    }
    std::sort(moves.begin(), moves.end(), [](const Move& a, const Move& b) { return a.after < b.after; });
    for (const auto& [v, star, goal, before, after] : moves) {
        const Vec3 from = points[v];
        const double height = mesh.probe.value(from);
        const double lift = std::abs(height) > kFitted * mesh.tolerance ? kLift * mesh.tolerance : 0.0;
        const std::vector<Triangle> around = triangles_of(star, mesh);
        const Replaced replaced = mesh.replaced(star.triangle);
        Vec3 way = goal - from;
        for (int halving = 0; halving <= kHalvings; ++halving, way *= 0.5) {
            const auto on_surface = mesh.probe.project(from + way);
            if (!on_surface) continue;
            const Vec3 n = mesh.probe.normal(*on_surface);
            for (const double h : {height, height + lift, height - lift}) {
                const Vec3 to = to_float_precision(*on_surface + h * n);
                if (!(star.sharpness_at(to) < worth(before))) continue;
                points[v] = to;
                if (mesh.may_have(around, replaced)) return moved(mesh, star, around, v, from);
                points[v] = from;
                if (lift == 0.0) break;
            }
        }
    }
    if (!(sharpness > kSharpnessAt18Degrees) || mesh.searched[triangle]) return std::nullopt;
    const Triangle& corners = mesh.triangles[triangle];
    const bool is_free =
        std::none_of(corners.begin(), corners.end(), [&](int v) { return mesh.touched[v] != 0; });
    auto found = search(mesh, triangle);
    mesh.searched[triangle] = !found && is_free;
    return found;
}

}  // namespace isotrack
