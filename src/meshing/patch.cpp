#include "meshing/patch.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <map>
#include <tuple>
#include <unordered_map>
#include <utility>

#include "disjoint_sets.h"
#include "isotrack/meshing/self_intersections.h"
#include "meshing/triangle_distance.h"
#include "sampling/compact.h"

namespace isotrack {
namespace {

constexpr double kSeam = 0.6;      // spacings: vertices that come are no nearer to what stays
constexpr double kMargin = 2.0;    // spacings: how far what comes may be from what goes
constexpr double kFarthest = 4.0;  // spacings, on average: loops farther apart do not match
constexpr double kFar = std::numeric_limits<double>::infinity();
constexpr int kMostRounds = 8;               // of leaving out what a strip crosses
constexpr std::size_t kMostSteps = 1 << 20;  // of a strip: the product of the lengths of its loops

using Loop = std::vector<int>;

/// The edges of triangles, ascending by their ends, the lower first.
class SortedEdges {
public:
    explicit SortedEdges(const std::vector<Triangle>& triangles) {
        edges_.reserve(3 * triangles.size());
        for (const Triangle& t : triangles)
            for (int k = 0; k < 3; ++k) {
                const auto from = static_cast<std::uint64_t>(t[k]),
                           to = static_cast<std::uint64_t>(t[(k + 1) % 3]);
                edges_.push_back(from < to ? from << 32 | to << 1 : to << 32 | from << 1 | 1);
            }
        std::sort(edges_.begin(), edges_.end());
    }
    /// Calls `visit(low, high, upwards, downwards)` for each: how many triangles have it, by how it runs.
    template <typename Visit>
    void for_each(const Visit& visit) const {
        for (auto e = edges_.begin(); e != edges_.end();) {
            const std::uint64_t ends = *e >> 1;
            int runs[2] = {0, 0};
            for (; e != edges_.end() && *e >> 1 == ends; ++e) ++runs[*e & 1];
            visit(static_cast<int>(ends >> 31), static_cast<int>(ends & 0x7fffffff), runs[0], runs[1]);
        }
    }

private:
    std::vector<std::uint64_t> edges_;
};

/// The edges of triangles that have one of them alone, each as it runs there, ascending.
std::vector<std::pair<int, int>> border_of(const std::vector<Triangle>& triangles) {
    std::vector<std::pair<int, int>> result;
    SortedEdges(triangles).for_each([&](int low, int high, int upwards, int downwards) {
        if (downwards == 0) result.insert(result.end(), upwards, {low, high});
        if (upwards == 0) result.insert(result.end(), downwards, {high, low});
    });
    std::sort(result.begin(), result.end());
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

struct Numbers {
    long components, euler;
    long loops;  // that the border has
};

/// Of triangles with all their edges and corners, and a border that is pinched nowhere.
Numbers numbers_of(const std::vector<Triangle>& triangles) {
    std::vector<int> corners;
    for (const Triangle& t : triangles) corners.insert(corners.end(), t.begin(), t.end());
    std::sort(corners.begin(), corners.end());
    corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
    const auto number_of = [&](int v) {
        return static_cast<int>(std::lower_bound(corners.begin(), corners.end(), v) - corners.begin());
    };
    DisjointSets sets(corners.size()), along_border(corners.size());
    long components = static_cast<long>(corners.size()), edges = 0, loops = 0;
    SortedEdges(triangles).for_each([&](int low, int high, int upwards, int downwards) {
        const int from = number_of(low), to = number_of(high);
        components -= sets.join(from, to);
        // The edge that closes a loop joins nothing.
        if (upwards + downwards == 1) loops += !along_border.join(from, to);
        ++edges;
    });
    return {components, static_cast<long>(corners.size()) - edges + static_cast<long>(triangles.size()),
            loops};
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
/// edges across among those that face as the `normals` at the second do. Empty where there are too many ways.
std::vector<Triangle> strip_between(const Loop& outer, const Loop& inner, const std::vector<Vec3>& points,
                                    const std::vector<Vec3>& normals) {
    constexpr double kFlatStrip = 0.05;  // twice the area over the square of the longest edge
    constexpr double kPenalty = 100.0;   // squares of the longest edge
    const std::size_t m = outer.size(), n = inner.size();
    if ((m + 1) * (n + 1) > kMostSteps) return {};
    std::size_t i0 = 0, j0 = 0;
    const auto out = [&](std::size_t i) { return outer[(i0 + i) % m]; };
    const auto in = [&](std::size_t j) { return inner[(j0 + j) % n]; };
    const auto across = [&](std::size_t i, std::size_t j) {
        return (points[out(i)] - points[in(j)]).squaredNorm();
    };
    std::pair<std::size_t, std::size_t> nearest;
    for (std::size_t i = 0; i < m; ++i)
        for (std::size_t j = 0; j < n; ++j)
            if (across(i, j) < across(nearest.first, nearest.second)) nearest = {i, j};
    std::tie(i0, j0) = nearest;
    const auto penalty = [&](const Triangle& t, const Vec3& normal) {
        const Vec3 &a = points[t[0]], &b = points[t[1]], &c = points[t[2]];
        const double longest2 =
            std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
        return area_vector(t, points).dot(normal) > kFlatStrip * longest2 ? 0.0 : kPenalty * longest2;
    };
    const auto by_outer = [&](std::size_t i, std::size_t j) { return Triangle{out(i - 1), out(i), in(j)}; };
    const auto by_inner = [&](std::size_t i, std::size_t j) { return Triangle{out(i), in(j), in(j - 1)}; };
    // The least sum of squares on the way from (0, 0) to (i, j). It begins along the outer loop and ends
    // along the inner one, so that no edge across comes twice.
    std::vector<double> sum((m + 1) * (n + 1), kFar);
    std::vector<char> from_outer(sum.size(), 0);
    const auto at = [&](std::size_t i, std::size_t j) { return i * (n + 1) + j; };
    sum[0] = 0.0;
    for (std::size_t i = 1; i <= m; ++i)
        for (std::size_t j = 0; j <= n; ++j) {
            if ((i == m && j == 0) || (i < m && j == n)) continue;
            const Vec3& normal = normals[in(j)];
            const double outer_sum = sum[at(i - 1, j)] + penalty(by_outer(i, j), normal);
            const double inner_sum = j > 0 ? sum[at(i, j - 1)] + penalty(by_inner(i, j), normal) : kFar;
            from_outer[at(i, j)] = outer_sum < inner_sum;
            sum[at(i, j)] = std::min(outer_sum, inner_sum) + across(i, j);
        }
    std::vector<Triangle> result;
    for (std::size_t i = m, j = n; i + j > 0;) {
        const bool outwards = from_outer[at(i, j)];
        result.push_back(outwards ? by_outer(i, j) : by_inner(i, j));
        --(outwards ? i : j);
    }
    return result;
}

std::vector<Triangle> some_of(const std::vector<Triangle>& triangles, const std::vector<int>& some) {
    std::vector<Triangle> result;
    for (const int t : some) result.push_back(triangles[t]);
    return result;
}

/// Some triangles with vertices of their own.
struct Part {
    std::vector<int> vertices;  // of the mesh they are from
    std::vector<Triangle> triangles;
};

Part part_within(const Box& bounds, const TriangleTree& mesh) {
    Part result;
    std::unordered_map<int, int> number;
    for (const int t : mesh.meeting(bounds)) {
        if (!bounds.contains(mesh.box_of(t))) continue;
        result.triangles.push_back(mesh.triangles()[t]);
        for (int& v : result.triangles.back()) {
            const auto [entry, is_new] = number.try_emplace(v, static_cast<int>(number.size()));
            if (is_new) result.vertices.push_back(v);
            v = entry->second;
        }
    }
    return result;
}

/// Whether places are near the edges of a border.
class Seam {
public:
    Seam(const std::vector<std::pair<int, int>>& border, const std::vector<Vec3>& points, double width)
        : width2_(width * width) {
        for (const auto& [from, to] : border) {
            const Vec3 along = points[to] - points[from];
            const double length2 = along.squaredNorm(), reach = 0.5 * std::sqrt(length2) + width;
            edges_.push_back({points[from], along, length2 > 0.0 ? 1.0 / length2 : 0.0,
                              points[from] + 0.5 * along, reach * reach});
        }
    }
    bool is_near(const Vec3& p) const {
        return std::any_of(edges_.begin(), edges_.end(), [&](const Edge& e) {
            if ((p - e.middle).squaredNorm() > e.reach2) return false;
            const Vec3 to_p = p - e.from;
            const double t = std::clamp(to_p.dot(e.along) * e.inverse_length2, 0.0, 1.0);
            return (to_p - t * e.along).squaredNorm() < width2_;
        });
    }

private:
    struct Edge {
        Vec3 from, along;
        double inverse_length2;
        Vec3 middle;
        double reach2;  // of what is near the edge, from its middle
    };
    std::vector<Edge> edges_;
    double width2_;
};

/// Flags for the vertices of a part: it is nearer to what goes than to what stays, and not in the seam.
std::vector<char> coming_vertices(const Part& part, const std::vector<Vec3>& points,
                                  const std::vector<int>& gone,
                                  const std::vector<std::pair<int, int>>& border, PatchSource& source) {
    source.look_beside(part.vertices);
    const Seam seam(border, points, kSeam * source.spacing());
    std::vector<char> result;
    for (const int v : part.vertices) {
        const int beside = source.beside(v);
        result.push_back(std::binary_search(gone.begin(), gone.end(), beside) &&
                         !seam.is_near(source.tree().points()[v]));
    }
    return result;
}

/// For each of some loops another that is near; none where they do not match one to one. Others may be left.
std::vector<int> matches(const std::vector<Loop>& loops, const std::vector<Loop>& others,
                         const std::vector<Vec3>& points, double farthest) {
    std::vector<int> result;
    for (const Loop& loop : loops) {
        double least = farthest;
        int best = -1;
        for (std::size_t o = 0; o < others.size(); ++o) {
            double sum = 0.0;
            for (const int v : loop) {
                double nearest = kFar;
                for (const int w : others[o])
                    nearest = std::min(nearest, (points[v] - points[w]).squaredNorm());
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

template <typename IsOut>
void leave_out(std::vector<Triangle>& triangles, const IsOut& is_out) {
    triangles.erase(std::remove_if(triangles.begin(), triangles.end(), is_out), triangles.end());
}

/// The strips from some loops to the borders of what comes, of which it leaves out pieces without a loop that
/// matches; others must match with all of theirs. nullopt where they do not.
std::optional<std::vector<Triangle>> join(const std::vector<Loop>& outer, std::vector<Triangle>& coming,
                                          const std::vector<Vec3>& points, const std::vector<Vec3>& normals,
                                          double farthest) {
    auto border = border_of(coming);
    for (auto bad = pinched(border); !bad.empty(); bad = pinched(border)) {
        leave_out(coming, [&](const Triangle& t) { return has_any(t, bad); });
        border = border_of(coming);
    }
    const std::vector<Loop> inner = loops_of(border);
    const std::vector<int> match = matches(outer, inner, points, farthest);
    if (match.size() != outer.size()) return std::nullopt;
    DisjointSets pieces(normals.size());
    for (const Triangle& t : coming)
        for (const int v : {t[1], t[2]}) pieces.join(t[0], v);
    std::vector<char> is_matched(normals.size(), 0), is_out(normals.size(), 0);
    const auto piece_of = [&](const Loop& loop) { return pieces.least(loop.front()); };
    for (const int o : match) is_matched[piece_of(inner[o])] = 1;
    for (std::size_t o = 0; o < inner.size(); ++o) {
        if (std::find(match.begin(), match.end(), static_cast<int>(o)) != match.end()) continue;
        if (is_matched[piece_of(inner[o])]) return std::nullopt;
        is_out[piece_of(inner[o])] = 1;
    }
    leave_out(coming, [&](const Triangle& t) { return is_out[pieces.least(t[0])] != 0; });
    std::vector<Triangle> strips;
    for (std::size_t o = 0; o < outer.size(); ++o) {
        const auto strip = strip_between(outer[o], inner[match[o]], points, normals);
        if (strip.empty()) return std::nullopt;
        strips.insert(strips.end(), strip.begin(), strip.end());
    }
    return strips;
}

constexpr int kNotLookedFor = -2;

}  // namespace

PatchSource::PatchSource(TriangleMesh mesh, double spacing)
    : mesh_(std::move(mesh)),
      spacing_(spacing),
      tree_(TriangleTree::in_order(mesh_.points, mesh_.triangles)),
      normal_(mesh_.points.size(), Vec3::Zero()),
      beside_(mesh_.points.size()) {
    assert(spacing > 0.0);
    forget();
    for (const Triangle& t : mesh_.triangles) {
        const Vec3 normal = area_vector(t, mesh_.points);
        for (const int v : t) normal_[v] += normal;
    }
    for (Vec3& n : normal_) n.normalize();
}

void PatchSource::look_at(const TriangleTree& mesh) {
    looked_at_ = &mesh;
    forget();
}

void PatchSource::forget() {
    for (auto& beside : beside_) beside.store(kNotLookedFor, std::memory_order_relaxed);
}

void PatchSource::look_beside(const std::vector<int>& vertices) {
    constexpr double kLeast = 0.25;   // spacings: that it looks around at first
    constexpr double kLikely = 1.25;  // times as far as what is beside the vertex before, which is near
    constexpr double kRounding = 1.0 + 1e-12;  // ample: what is found must not depend on the order
    constexpr std::size_t kGrain = 64;
    const TriangleTree& mesh = *looked_at_;
    const std::vector<Vec3>& points = mesh.points();
    const double farthest = kMargin * spacing_;
    const auto find = [&](int v, double& likely) {
        const Vec3& p = mesh_.points[v];
        double nearest[2] = {kFar, kFar};
        int at[2] = {-1, -1};  // the nearest that faces another way, and the same way; of equals the first
        for (double distance = likely; !mesh.triangles().empty(); distance *= 2.0) {
            const auto look = [&](int other) {
                const double to_box = mesh.box_of(other).squaredExteriorDistance(p);
                if (to_box > kRounding * std::max(nearest[0], nearest[1])) return;
                const Triangle& t = mesh.triangles()[other];
                const bool same = area_vector(t, points).dot(normal_[v]) > 0.0;
                if (to_box > kRounding * nearest[same]) return;
                const double d = squared_distance(p, points[t[0]], points[t[1]], points[t[2]]);
                if (d < nearest[same] || (d == nearest[same] && other < at[same]))
                    nearest[same] = d, at[same] = other;
            };
            mesh.for_each_near(Box(p - Vec3::Constant(distance), p + Vec3::Constant(distance)), look);
            // What is farther may have been seen, but not all of it.
            const double seen2 = distance * distance;
            const bool same = nearest[1] <= std::max(farthest * farthest, nearest[0]);
            const double least2 = same ? nearest[1] : std::max(farthest * farthest, nearest[0]);
            if (!(least2 <= seen2)) continue;
            likely = std::max(kLeast * spacing_, kLikely * std::sqrt(nearest[same]));
            return at[same];
        }
        return -1;
    };
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, vertices.size(), kGrain), [&](const auto& range) {
        double likely = kLeast * spacing_;
        for (std::size_t i = range.begin(); i < range.end(); ++i)
            if (auto& beside = beside_[vertices[i]]; beside.load(std::memory_order_relaxed) == kNotLookedFor)
                beside.store(find(vertices[i], likely), std::memory_order_relaxed);
    });
}

Vec3 area_vector(const Triangle& t, const std::vector<Vec3>& at) {
    return (at[t[1]] - at[t[0]]).cross(at[t[2]] - at[t[0]]);
}

std::vector<int> triangles_around(const Vec3& place, double reach, const TriangleTree& mesh) {
    const std::vector<Vec3>& points = mesh.points();
    const Vec3 extent = Vec3::Constant(reach);
    std::vector<int> result;
    for (const int t : mesh.meeting(Box(place - extent, place + extent))) {
        const auto& [i, j, k] = mesh.triangles()[t];
        if (squared_distance(place, points[i], points[j], points[k]) <= reach * reach) result.push_back(t);
    }
    for (std::size_t before = 0; before != result.size();) {
        before = result.size();
        for (const int v : pinched(border_of(some_of(mesh.triangles(), result))))
            for (const int t : mesh.meeting(Box(points[v])))
                if (has_any(mesh.triangles()[t], {v})) result.push_back(t);
        std::sort(result.begin(), result.end());
        result.erase(std::unique(result.begin(), result.end()), result.end());
    }
    return result;
}

bool have_same_numbers(const std::vector<int>& some, const TriangleTree& mesh, const std::vector<int>& others,
                       const TriangleTree& other_mesh) {
    const Numbers a = numbers_of(some_of(mesh.triangles(), some)),
                  b = numbers_of(some_of(other_mesh.triangles(), others));
    return a.components == b.components && a.euler == b.euler && a.loops == b.loops;
}

std::optional<Patch> patch_for(const std::vector<int>& gone, const TriangleTree& mesh, PatchSource& source) {
    assert(source.looks_at(mesh));
    if (gone.empty()) return std::nullopt;
    const std::vector<Vec3>& points = mesh.points();
    Patch patch;
    patch.gone = gone;
    const std::vector<Triangle> going = some_of(mesh.triangles(), gone);
    const auto border = border_of(going);
    Box bounds;
    for (const int t : gone) bounds.extend(mesh.box_of(t));
    const Vec3 margin = Vec3::Constant(kMargin * source.spacing());
    Part part = part_within(Box(bounds.min() - margin, bounds.max() + margin), source.tree());
    const auto comes = coming_vertices(part, points, gone, border, source);
    // What comes and the border have numbers of their own, the border's behind the others.
    const auto own = part.vertices.size();
    std::vector<Vec3> at, normals;
    for (const int v : part.vertices) {
        at.push_back(source.tree().points()[v]);
        normals.push_back(source.normal(v));
    }
    patch.points = at;
    std::vector<int> rim;
    for (const auto& edge : border) {
        rim.push_back(edge.first);
        at.push_back(points[edge.first]);
    }
    const auto on_rim = [&](int v) {
        return static_cast<int>(own) +
               static_cast<int>(std::lower_bound(rim.begin(), rim.end(), v) - rim.begin());
    };
    std::vector<std::pair<int, int>> outline;
    for (const auto& [from, to] : border) outline.emplace_back(on_rim(from), on_rim(to));
    const std::vector<Loop> outer = loops_of(outline);

    std::vector<Triangle>& coming = part.triangles;
    leave_out(coming, [&](const Triangle& t) {
        return std::any_of(t.begin(), t.end(), [&](int v) { return !comes[v]; });
    });
    std::vector<Triangle> all;
    std::vector<Triangle> looked_at;  // strips of the round before, ascending
    // What comes and is crossed by a strip makes way for it.
    for (int round = 0; round < kMostRounds; ++round) {
        auto strips = join(outer, coming, at, normals, kFarthest * source.spacing());
        if (!strips) return std::nullopt;
        all = coming;
        all.insert(all.end(), strips->begin(), strips->end());
        std::sort(strips->begin(), strips->end());
        std::vector<Triangle> fresh;
        std::set_difference(strips->begin(), strips->end(), looked_at.begin(), looked_at.end(),
                            std::back_inserter(fresh));
        const std::vector<char> crossed = crossed_by(at, fresh, coming);
        if (std::find(crossed.begin(), crossed.end(), 1) == crossed.end()) break;
        std::size_t next = 0;
        leave_out(coming, [&](const Triangle&) { return crossed[next++]; });
        looked_at = std::move(*strips);
    }
    const Numbers now = numbers_of(all), before = numbers_of(going);
    patch.components = now.components - before.components;
    patch.euler = now.euler - before.euler;
    for (Triangle& t : all)
        for (int& v : t)
            v = static_cast<std::size_t>(v) < own ? static_cast<int>(points.size()) + v : rim[v - own];
    patch.triangles = std::move(all);
    return patch;
}

bool stays_manifold(const Patch& patch, const TriangleTree& mesh) {
    std::vector<int> corners;
    const auto add_corners = [&](const Triangle& t) { corners.insert(corners.end(), t.begin(), t.end()); };
    for (const Triangle& t : patch.triangles) add_corners(t);
    for (const int t : patch.gone) add_corners(mesh.triangles()[t]);
    std::sort(corners.begin(), corners.end());
    corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
    using Turn = std::array<int, 3>;  // around a vertex, from one neighbour to the next
    std::vector<Turn> turns;
    const auto add = [&](const Triangle& t, int v) {
        for (int k = 0; k < 3; ++k)
            if (t[k] == v) turns.push_back({v, t[(k + 1) % 3], t[(k + 2) % 3]});
    };
    for (const Triangle& t : patch.triangles)
        for (const int v : t) add(t, v);
    for (const int v : corners) {
        if (static_cast<std::size_t>(v) >= mesh.points().size()) break;  // no other has those that come
        for (const int t : mesh.meeting(Box(mesh.points()[v])))
            if (!std::binary_search(patch.gone.begin(), patch.gone.end(), t)) add(mesh.triangles()[t], v);
    }
    std::sort(turns.begin(), turns.end());
    const auto is_one_fan = [](auto begin, auto end) {
        for (auto turn = begin; turn + 1 != end; ++turn)
            if ((*turn)[1] == (*(turn + 1))[1]) return false;
        auto at = begin;
        for (auto steps = end - begin; steps > 0; --steps) {
            const int to = (*at)[2];
            at = std::lower_bound(begin, end, to, [](const Turn& turn, int v) { return turn[1] < v; });
            if (at == end || (*at)[1] != to) return false;
            if (at == begin) return steps == 1;
        }
        return false;
    };
    for (auto begin = turns.begin(); begin != turns.end();) {
        const auto end =
            std::find_if(begin, turns.end(), [&](const Turn& turn) { return turn[0] != (*begin)[0]; });
        if (!is_one_fan(begin, end)) return false;
        begin = end;
    }
    return true;
}

}  // namespace isotrack
