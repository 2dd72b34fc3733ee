#include "isotrack/meshing/self_intersections.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <string>

#include "find_in_blocks.h"
#include "isotrack/error.h"
#include "meshing/box_tree.h"
#include "meshing/triangle_box.h"
#include "parallel_for_each.h"

namespace isotrack {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Pairs = std::vector<std::pair<int, int>>;

Kernel::Point_3 to_cgal(const Vec3& p) {
    return {p.x(), p.y(), p.z()};
}

Kernel::Triangle_3 to_cgal(const Vec3& a, const Vec3& b, const Vec3& c) {
    return {to_cgal(a), to_cgal(b), to_cgal(c)};
}

bool has_area(const Vec3& a, const Vec3& b, const Vec3& c) {
    return !CGAL::collinear(to_cgal(a), to_cgal(b), to_cgal(c));
}

/// Whether a plane through `apex` has p and q strictly on one side and r and s strictly on the other. The
/// planes tried are the one between their middles and the one between the bisectors of the two wedges, which
/// is right for almost all neighbours round a vertex. True is certain, false is not.
bool are_clearly_apart(const Vec3& apex, const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& s) {
    // Coordinate differences are exact to half a unit in the last place, so a dot product of three terms is
    // wrong by less than 8 eps |x| |d|, with lengths in the maximum norm.
    constexpr double kMargin = 1e-14;
    const Vec3 a = p - apex, b = q - apex, c = r - apex, d = s - apex;
    const auto parts = [&](const Vec3& direction) {
        const double margin = kMargin * direction.lpNorm<1>();
        return a.dot(direction) > margin * a.lpNorm<1>() && b.dot(direction) > margin * b.lpNorm<1>() &&
               c.dot(direction) < -margin * c.lpNorm<1>() && d.dot(direction) < -margin * d.lpNorm<1>();
    };
    return parts((a + b) - (c + d)) || parts((a / a.norm() + b / b.norm()) - (c / c.norm() + d / d.norm()));
}

/// Whether segment pq meets triangle abc, which has area.
bool meets(const Vec3& p, const Vec3& q, const Vec3& a, const Vec3& b, const Vec3& c) {
    return CGAL::do_intersect(Kernel::Segment_3(to_cgal(p), to_cgal(q)), to_cgal(a, b, c));
}

/// Whether two triangles with area share more than their common vertices and edges. Vertices are common by
/// place.
bool cross(const std::vector<Vec3>& points, const Triangle& first, const Triangle& second) {
    const Vec3* const a[3] = {&points[first[0]], &points[first[1]], &points[first[2]]};
    const Vec3* const b[3] = {&points[second[0]], &points[second[1]], &points[second[2]]};
    int common = 0;
    int in_a = 0, in_b = 0;  // sums of the positions that are common
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            if (a[i] == b[j] || *a[i] == *b[j]) ++common, in_a += i, in_b += j;
    switch (common) {
        case 0:
            return CGAL::do_intersect(to_cgal(*a[0], *a[1], *a[2]), to_cgal(*b[0], *b[1], *b[2]));
        case 1: {
            // Whatever else they share reaches, seen from the common vertex, the far edge of one of them
            // inside the other.
            const Vec3 &apex = *a[in_a], &p = *a[(in_a + 1) % 3], &q = *a[(in_a + 2) % 3];
            const Vec3 &r = *b[(in_b + 1) % 3], &s = *b[(in_b + 2) % 3];
            return !are_clearly_apart(apex, p, q, r, s) &&
                   (meets(p, q, apex, r, s) || meets(r, s, apex, p, q));
        }
        case 2: {
            // Folded over: in one plane and on the same side of the common edge.
            const int tip = 3 - in_a;
            const auto u = to_cgal(*a[(tip + 1) % 3]), v = to_cgal(*a[(tip + 2) % 3]);
            const auto p = to_cgal(*a[tip]), q = to_cgal(*b[3 - in_b]);
            return CGAL::coplanar(u, v, p, q) && CGAL::coplanar_orientation(u, v, p, q) == CGAL::POSITIVE;
        }
        default:
            return true;  // the same triangle twice
    }
}

/// Throws where a vertex is not finite or a triangle names one that is not there.
void check(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles) {
    for (std::size_t i = 0; i < points.size(); ++i)
        if (!points[i].allFinite()) throw InputError("vertex " + std::to_string(i) + " is not finite");
    for (std::size_t i = 0; i < triangles.size(); ++i)
        for (const int v : triangles[i])
            if (v < 0 || static_cast<std::size_t>(v) >= points.size())
                throw InputError("triangle " + std::to_string(i) + " names vertex " + std::to_string(v) +
                                 " of a mesh with " + std::to_string(points.size()) + " vertices");
}

std::vector<char> with_area(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles) {
    constexpr std::size_t kGrain = 1024;
    std::vector<char> result(triangles.size());
    parallel_for_each(triangles.size(), kGrain, [&](std::size_t t) {
        const auto& [i, j, k] = triangles[t];
        result[t] = has_area(points[i], points[j], points[k]);
    });
    return result;
}

}  // namespace

std::vector<std::pair<int, int>> self_intersections(const std::vector<Vec3>& points,
                                                    const std::vector<Triangle>& triangles) {
    constexpr std::size_t kLeavesPerBlock = 32;
    check(points, triangles);
    const BoxTree tree(points, triangles, with_area(points, triangles));
    Pairs result = find_in_blocks<std::pair<int, int>>(
        tree.leaf_count(), kLeavesPerBlock, [&](std::size_t begin, std::size_t end, Pairs& found) {
            for (std::size_t leaf = begin; leaf < end; ++leaf)
                tree.for_each_pair_of(leaf, [&](int t, int u) {
                    if (cross(points, triangles[t], triangles[u])) found.push_back(std::minmax(t, u));
                });
        });
    std::sort(result.begin(), result.end());
    return result;
}

bool any_cross(const std::vector<Vec3>& points, const std::vector<Triangle>& some,
               const std::vector<Triangle>& others) {
    struct Boxed {
        Box box;
        const Triangle* triangle;
    };
    const auto with_box = [&](const Triangle& t) { return Boxed{box_of(points, t), &t}; };
    const auto area = [&](const Triangle& t) { return has_area(points[t[0]], points[t[1]], points[t[2]]); };
    std::vector<Boxed> ours, near;
    ours.reserve(some.size());
    near.reserve(others.size());
    Box bounds;
    for (const Triangle& t : some)
        if (area(t)) {
            ours.push_back(with_box(t));
            bounds.extend(ours.back().box);
        }
    for (const Triangle& t : others)
        if (const Boxed other = with_box(t); bounds.intersects(other.box) && area(t)) near.push_back(other);
    for (auto t = ours.begin(); t != ours.end(); ++t) {
        const auto is_crossed_by = [&](const Boxed& other) {
            return t->box.intersects(other.box) && cross(points, *t->triangle, *other.triangle);
        };
        if (std::any_of(t + 1, ours.end(), is_crossed_by) ||
            std::any_of(near.begin(), near.end(), is_crossed_by))
            return true;
    }
    return false;
}

std::vector<char> crossed_by(const std::vector<Vec3>& points, const std::vector<Triangle>& some,
                             const std::vector<Triangle>& others) {
    std::vector<char> crossed(others.size(), 0);
    tbb::this_task_arena::isolate([&] {
        Box bounds;
        for (const Triangle& t : some) bounds.extend(box_of(points, t));
        std::vector<char> near = with_area(points, others);
        for (std::size_t t = 0; t < others.size(); ++t)
            near[t] = near[t] && bounds.intersects(box_of(points, others[t]));
        const BoxTree tree(points, others, near);
        for (const Triangle& s : some)
            if (has_area(points[s[0]], points[s[1]], points[s[2]]))
                tree.for_each_meeting(box_of(points, s),
                                      [&](int t) { crossed[t] = crossed[t] || cross(points, s, others[t]); });
    });
    return crossed;
}

}  // namespace isotrack
