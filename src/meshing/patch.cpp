#include "meshing/patch.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>
#include <utility>

#include "disjoint_sets.h"
#include "meshing/triangle_distance.h"
#include "sampling/compact.h"

namespace isotrack {
namespace {

constexpr double kSeam = 0.6;      // spacings: vertices that come are no nearer to what stays
constexpr double kMargin = 2.0;    // spacings: how far what comes may be from what goes
constexpr double kFarthest = 4.0;  // spacings, on average: loops farther apart do not match
constexpr double kFar = std::numeric_limits<double>::infinity();
constexpr std::size_t kMostSteps = 1 << 20;  // of a strip: the product of the lengths of its loops

using Loop = std::vector<int>;

double squared_distance_to_edge(const Vec3& p, const Vec3& a, const Vec3& b) {
    const Vec3 ab = b - a, ap = p - a;
    const double length2 = ab.squaredNorm();
    const double t = length2 > 0.0 ? std::clamp(ap.dot(ab) / length2, 0.0, 1.0) : 0.0;
    return (ap - t * ab).squaredNorm();
}

Box box_of(const Triangle& t, const std::vector<Vec3>& points) {
    Box box(points[t[0]]);
    return box.extend(points[t[1]]).extend(points[t[2]]);
}

/// The edges of triangles that have one of them alone, each as it runs there, ascending.
std::vector<std::pair<int, int>> border_of(const std::vector<Triangle>& triangles) {
    std::vector<std::pair<int, int>> edges, result;
    for (const Triangle& t : triangles)
        for (int k = 0; k < 3; ++k) edges.emplace_back(t[k], t[(k + 1) % 3]);
    std::sort(edges.begin(), edges.end());
    std::copy_if(edges.begin(), edges.end(), std::back_inserter(result), [&](const auto& e) {
        return !std::binary_search(edges.begin(), edges.end(), std::pair(e.second, e.first));
    });
    return result;
}

/// The vertices where a border comes by more than once.
std::vector<int> pinched(const std::vector<std::pair<int, int>>& border) {
    std::vector<int> result;
    for (std::size_t e = 1; e < border.size(); ++e)
        if (border[e].first == border[e - 1].first) result.push_back(border[e].first);
    return result;
}

bool has_any(const Triangle& t, const std::vector<int>& ascending) {
    return std::any_of(t.begin(), t.end(),
                       [&](int v) { return std::binary_search(ascending.begin(), ascending.end(), v); });
}

/// The Euler number of triangles with all their edges and corners.
long euler_of(const std::vector<Triangle>& triangles) {
    std::vector<int> corners;
    std::vector<std::pair<int, int>> edges;
    for (const Triangle& t : triangles)
        for (int k = 0; k < 3; ++k) {
            corners.push_back(t[k]);
            edges.emplace_back(std::minmax(t[k], t[(k + 1) % 3]));
        }
    const auto count = [](auto& values) {
        std::sort(values.begin(), values.end());
        return std::unique(values.begin(), values.end()) - values.begin();
    };
    return static_cast<long>(count(corners) - count(edges)) + static_cast<long>(triangles.size());
}

/// Of a border that is pinched nowhere.
std::vector<Loop> loops_of(const std::vector<std::pair<int, int>>& border) {
    std::map<int, int> next(border.begin(), border.end());
    std::vector<Loop> result;
    while (!next.empty()) {
        result.emplace_back();
        for (auto at = next.begin(); at != next.end();) {
            result.back().push_back(at->first);
            const int to = at->second;
            next.erase(at);
            at = next.find(to);
        }
    }
    return result;
}

/// Triangles between two loops that run the same way round, the first outside the second, with the shortest
/// edges across. Empty where there are too many ways.
std::vector<Triangle> strip_between(const Loop& outer, const Loop& inner,
                                    const std::vector<Vec3>& outer_points,
                                    const std::vector<Vec3>& inner_points, int first_inner) {
    const std::size_t m = outer.size(), n = inner.size();
    if ((m + 1) * (n + 1) > kMostSteps) return {};
    std::size_t i0 = 0, j0 = 0;
    const auto across = [&](std::size_t i, std::size_t j) {
        return (outer_points[outer[(i0 + i) % m]] - inner_points[inner[(j0 + j) % n]]).squaredNorm();
    };
    std::pair<std::size_t, std::size_t> nearest;
    for (std::size_t i = 0; i < m; ++i)
        for (std::size_t j = 0; j < n; ++j)
            if (across(i, j) < across(nearest.first, nearest.second)) nearest = {i, j};
    std::tie(i0, j0) = nearest;
    // The least sum of squares on the way from (0, 0) to (i, j). It begins along the outer loop and ends
    // along the inner one, so that no edge across comes twice.
    std::vector<double> sum((m + 1) * (n + 1), kFar);
    std::vector<char> from_outer(sum.size(), 0);
    const auto at = [&](std::size_t i, std::size_t j) { return i * (n + 1) + j; };
    sum[0] = 0.0;
    for (std::size_t i = 1; i <= m; ++i)
        for (std::size_t j = 0; j <= n; ++j) {
            if ((i == m && j == 0) || (i < m && j == n)) continue;
            const double by_outer = sum[at(i - 1, j)], by_inner = j > 0 ? sum[at(i, j - 1)] : kFar;
            from_outer[at(i, j)] = by_outer < by_inner;
            sum[at(i, j)] = std::min(by_outer, by_inner) + across(i, j);
        }
    std::vector<Triangle> result;
    for (std::size_t i = m, j = n; i + j > 0;) {
        const int p = outer[(i0 + i) % m], q = first_inner + inner[(j0 + j) % n];
        if (from_outer[at(i, j)])
            result.push_back({outer[(i0 + --i) % m], p, q});
        else
            result.push_back({p, q, first_inner + inner[(j0 + --j) % n]});
    }
    return result;
}

std::vector<Triangle> flagged(std::vector<Triangle> triangles, const std::vector<char>& flags) {
    compact(triangles, flags);
    return triangles;
}

/// Flags for the triangles within reach of a place, and for those around where their border would be pinched.
std::vector<char> going_around(const Vec3& place, double reach, const std::vector<Vec3>& points,
                               const std::vector<Triangle>& triangles) {
    std::vector<char> result(triangles.size(), 0);
    for (std::size_t t = 0; t < triangles.size(); ++t) {
        const auto& [i, j, k] = triangles[t];
        result[t] = box_of(triangles[t], points).squaredExteriorDistance(place) <= reach * reach &&
                    squared_distance(place, points[i], points[j], points[k]) <= reach * reach;
    }
    for (;;) {
        const std::vector<int> bad = pinched(border_of(flagged(triangles, result)));
        if (bad.empty()) return result;
        for (std::size_t t = 0; t < triangles.size(); ++t)
            result[t] = result[t] || has_any(triangles[t], bad);
    }
}

/// The triangles of a mesh within a box, with vertices of their own.
TriangleMesh part_within(const Box& bounds, const TriangleMesh& mesh) {
    TriangleMesh result;
    std::map<int, int> number;
    for (const Triangle& t : mesh.triangles) {
        if (!bounds.contains(box_of(t, mesh.points))) continue;
        result.triangles.push_back(t);
        for (int& v : result.triangles.back()) {
            const auto [entry, is_new] = number.try_emplace(v, static_cast<int>(number.size()));
            if (is_new) result.points.push_back(mesh.points[v]);
            v = entry->second;
        }
    }
    return result;
}

Vec3 area(const Triangle& t, const std::vector<Vec3>& at) {
    return (at[t[1]] - at[t[0]]).cross(at[t[2]] - at[t[0]]);
}

/// Flags for the vertices of a part of another mesh that are nearer to what goes than to what stays, by
/// triangles that face the same way if there are any, and not within the seam along `border`.
std::vector<char> coming_vertices(const TriangleMesh& part, const std::vector<Vec3>& points,
                                  const std::vector<Triangle>& triangles, const std::vector<char>& gone,
                                  const std::vector<std::pair<int, int>>& border, double seam) {
    std::vector<Vec3> normal(part.points.size(), Vec3::Zero());
    Box bounds;
    for (const Triangle& t : part.triangles) {
        bounds.extend(box_of(t, part.points));
        for (const int v : t) normal[v] += area(t, part.points);
    }
    const Vec3 margin = 0.25 * bounds.sizes();
    bounds = Box(bounds.min() - margin, bounds.max() + margin);
    struct Near {
        Box box;
        Vec3 area;
        std::size_t triangle;
    };
    std::vector<Near> near;
    for (std::size_t t = 0; t < triangles.size(); ++t)
        if (const Box box = box_of(triangles[t], points); bounds.intersects(box))
            near.push_back({box, area(triangles[t], points), t});
    std::vector<char> result(part.points.size());
    tbb::parallel_for(std::size_t{0}, result.size(), [&](std::size_t v) {
        const Vec3& p = part.points[v];
        double nearest[2] = {kFar, kFar};
        bool goes[2] = {false, false};  // the nearest that faces another way, and the same way
        for (const Near& other : near) {
            const bool same = other.area.dot(normal[v]) > 0.0;
            if (other.box.squaredExteriorDistance(p) >= nearest[same]) continue;
            const auto& [i, j, k] = triangles[other.triangle];
            const double d = squared_distance(p, points[i], points[j], points[k]);
            if (d < nearest[same]) nearest[same] = d, goes[same] = gone[other.triangle] != 0;
        }
        result[v] = goes[nearest[1] < kFar] && std::none_of(border.begin(), border.end(), [&](const auto& e) {
                        return squared_distance_to_edge(p, points[e.first], points[e.second]) < seam * seam;
                    });
    });
    return result;
}

/// For each of some loops another that is near; none where they do not match one to one. Others may be left.
std::vector<int> matches(const std::vector<Loop>& loops, const std::vector<Loop>& others,
                         const std::vector<Vec3>& points, const std::vector<Vec3>& other_points,
                         double farthest) {
    std::vector<int> result;
    for (const Loop& loop : loops) {
        double least = farthest;
        int best = -1;
        for (std::size_t o = 0; o < others.size(); ++o) {
            double sum = 0.0;
            for (const int v : loop) {
                double nearest = kFar;
                for (const int w : others[o])
                    nearest = std::min(nearest, (points[v] - other_points[w]).squaredNorm());
                sum += std::sqrt(nearest);
            }
            if (sum / static_cast<double>(loop.size()) < least) {
                least = sum / static_cast<double>(loop.size());
                best = static_cast<int>(o);
            }
        }
        if (best < 0 || std::find(result.begin(), result.end(), best) != result.end()) return {};
        result.push_back(best);
    }
    return result;
}

}  // namespace

std::optional<Patch> patch_around(const Vec3& place, double reach, const std::vector<Vec3>& points,
                                  const std::vector<Triangle>& triangles, const TriangleMesh& fine,
                                  double spacing) {
    Patch patch;
    patch.gone = going_around(place, reach, points, triangles);
    const std::vector<Triangle> going = flagged(triangles, patch.gone);
    if (going.empty()) return std::nullopt;
    const auto border = border_of(going);
    Box bounds;
    for (const Triangle& t : going) bounds.extend(box_of(t, points));
    const Vec3 margin = Vec3::Constant(kMargin * spacing);
    TriangleMesh part = part_within(Box(bounds.min() - margin, bounds.max() + margin), fine);
    const auto comes = coming_vertices(part, points, triangles, patch.gone, border, kSeam * spacing);
    std::vector<Triangle>& coming = part.triangles;
    const auto leave_out = [&](const auto& is_out) {
        coming.erase(std::remove_if(coming.begin(), coming.end(), is_out), coming.end());
    };
    leave_out(
        [&](const Triangle& t) { return std::any_of(t.begin(), t.end(), [&](int v) { return !comes[v]; }); });
    for (auto bad = pinched(border_of(coming)); !bad.empty(); bad = pinched(border_of(coming)))
        leave_out([&](const Triangle& t) { return has_any(t, bad); });

    // Pieces without a loop that matches are left out, others must match with all of theirs.
    const std::vector<Loop> outer = loops_of(border), inner = loops_of(border_of(coming));
    const std::vector<int> match = matches(outer, inner, points, part.points, kFarthest * spacing);
    if (match.size() != outer.size()) return std::nullopt;
    DisjointSets pieces(part.points.size());
    for (const Triangle& t : coming)
        for (const int v : {t[1], t[2]}) pieces.join(t[0], v);
    std::vector<char> is_matched(part.points.size(), 0), is_out(part.points.size(), 0);
    const auto piece_of = [&](const Loop& loop) { return pieces.least(loop.front()); };
    for (const int o : match) is_matched[piece_of(inner[o])] = 1;
    for (std::size_t o = 0; o < inner.size(); ++o) {
        if (std::find(match.begin(), match.end(), static_cast<int>(o)) != match.end()) continue;
        if (is_matched[piece_of(inner[o])]) return std::nullopt;
        is_out[piece_of(inner[o])] = 1;
    }
    leave_out([&](const Triangle& t) { return is_out[pieces.least(t[0])] != 0; });
    const int first = static_cast<int>(points.size());
    for (const auto& [i, j, k] : coming) patch.triangles.push_back({first + i, first + j, first + k});
    for (std::size_t o = 0; o < outer.size(); ++o) {
        const auto strip = strip_between(outer[o], inner[match[o]], points, part.points, first);
        if (strip.empty()) return std::nullopt;
        patch.triangles.insert(patch.triangles.end(), strip.begin(), strip.end());
    }
    patch.euler = euler_of(patch.triangles) - euler_of(going);
    patch.points = std::move(part.points);
    return patch;
}

}  // namespace isotrack
