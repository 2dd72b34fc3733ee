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
// Of the places around one, the bluntest: where none of them may be, others seldom may.
constexpr std::size_t kMostTried = 12;
constexpr int kHalvings = 2;      // of a move that leaves the tolerance
constexpr double kFitted = 0.01;  // tolerances: what is that far off may be farther off
constexpr double kLift = 0.25;    // tolerances: so far up or down

/// The triangles around a vertex.
struct Star {
    std::vector<int> triangle;
    std::vector<int> corner;                    // which of each the vertex is
    std::vector<std::array<Vec3, 2>> opposite;  // edge of each
    double mean_edge = 0.0;

    Star(int v, const BluntedMesh& mesh) {
        const auto& [points, triangles, corners] = std::tie(mesh.points, mesh.triangles, mesh.corners);
        for (int e = corners.first[v]; e < corners.first[v + 1]; ++e) {
            const int t = corners.corner[e] / 3, k = corners.corner[e] % 3;
            triangle.push_back(t);
            corner.push_back(k);
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
    /// Its triangles with the vertex at x.
    std::vector<Places> with(const Vec3& x) const {
        std::vector<Places> result(opposite.size());
        for (std::size_t i = 0; i < opposite.size(); ++i) {
            const int k = corner[i];
            result[i][k] = x;
            result[i][(k + 1) % 3] = opposite[i][0];
            result[i][(k + 2) % 3] = opposite[i][1];
        }
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

Proposal move_of(int v, const Star& star, const Vec3& to, const BluntedMesh& mesh) {
    Proposal result;
    result.change = {star.triangle, {}, v, mesh.points[v]};
    result.to = to;
    for (const int t : star.triangle) result.change.before.push_back(mesh.triangles[t]);
    return result;
}

/// The triangles near a star, to be crossed by it.
class Surroundings {
public:
    Surroundings(const Star& star, const Box& box, const BluntedMesh& mesh) : star_(star) {
        for (const Triangle& t : mesh.near(box, star.triangle)) {
            const int first = static_cast<int>(points_.size());
            for (const Vec3& p : mesh.places_of(t)) points_.push_back(p);
            others_.push_back({first, first + 1, first + 2});
        }
    }
    /// With the vertex at x. Corners are common by place.
    bool are_crossed(const Vec3& x) const {
        std::vector<Vec3> points = points_;
        std::vector<Triangle> around;
        for (const Places& t : star_.with(x)) {
            const int first = static_cast<int>(points.size());
            points.insert(points.end(), t.begin(), t.end());
            around.push_back({first, first + 1, first + 2});
        }
        return any_cross(points, around, others_);
    }

private:
    const Star& star_;
    std::vector<Vec3> points_;
    std::vector<Triangle> others_;
};

}  // namespace

std::optional<Proposal> nudge(const BluntedMesh& mesh, int triangle, Surface::Probe& probe) {
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
        const Vec3 from = mesh.points[v], normal = probe.normal(from);
        if (normal == Vec3::Zero()) continue;
        const Vec3 to = bluntest_place(star, from, normal);
        const double before = star.sharpness_at(from), after = star.sharpness_at(to);
        if (after < worth(before)) moves.push_back({v, std::move(star), to, before, after});
    }
    std::sort(moves.begin(), moves.end(), [](const Move& a, const Move& b) { return a.after < b.after; });
    for (const auto& [v, star, goal, before, after] : moves) {
        const Vec3 from = mesh.points[v];
        const double height = probe.value(from);
        const double lift = std::abs(height) > kFitted * mesh.tolerance ? kLift * mesh.tolerance : 0.0;
        std::optional<Replaced> replaced;  // when there is something to hold against it
        Vec3 way = goal - from;
        for (int halving = 0; halving <= kHalvings; ++halving, way *= 0.5) {
            const auto on_surface = probe.project(from + way);
            if (!on_surface) continue;
            const Vec3 n = probe.normal(*on_surface);
            for (const double h : {height, height + lift, height - lift}) {
                const Vec3 to = to_float_precision(*on_surface + h * n);
                if (!(star.sharpness_at(to) < worth(before))) continue;
                if (!replaced) replaced = mesh.replaced(star.triangle, probe);
                if (mesh.may_have(star.with(to), *replaced, probe)) return move_of(v, star, to, mesh);
                if (lift == 0.0) break;
            }
        }
    }
    return std::nullopt;
}

/// A pattern search over the places that the mesh may have, for each corner; the bluntest counts.
std::optional<Proposal> search(const BluntedMesh& mesh, int triangle, Surface::Probe& probe) {
    std::optional<Proposal> result;
    double bluntest = std::numeric_limits<double>::infinity();
    for (const int v : mesh.triangles[triangle]) {
        if (!mesh.movable[v] || mesh.touched[v]) continue;
        const Star star(v, mesh);
        std::optional<Replaced> before;
        std::optional<Surroundings> others;
        const auto may_go_to = [&](const Vec3& x) {
            // Most places are too far from the surface themselves.
            if (std::abs(probe.farther_value(x)) > mesh.tolerance) return false;
            if (!before) before = mesh.replaced(star.triangle, probe);
            if (!mesh.may_have(star.with(x), *before, probe)) return false;
            const Vec3 reach = Vec3::Constant(star.mean_edge);
            if (!others)
                others.emplace(star, Box(before->box.min() - reach, before->box.max() + reach), mesh);
            return !others->are_crossed(x);
        };
        Vec3 best = mesh.points[v];
        double least = star.sharpness_at(best);
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
            const auto tried = std::min(blunter.size(), kMostTried);
            std::partial_sort(blunter.begin(), blunter.begin() + static_cast<std::ptrdiff_t>(tried),
                              blunter.end(), [](const auto& p, const auto& q) { return p.first < q.first; });
            blunter.resize(tried);
            const auto found = std::find_if(blunter.begin(), blunter.end(), [&](const auto& candidate) {
                return may_go_to(candidate.second);
            });
            if (found == blunter.end())
                step *= 0.5;
            else
                std::tie(least, best) = *found;
        }
        if (!(least < enough) || !(least < bluntest)) continue;
        bluntest = least;
        result = move_of(v, star, best, mesh);
    }
    return result;
}

}  // namespace isotrack
