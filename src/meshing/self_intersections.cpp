#include "isotrack/meshing/self_intersections.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/box_intersection_d.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <string>

#include "isotrack/error.h"
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
/// plane tried is the one between the bisectors of the two wedges, which is right for almost all neighbours
/// round a vertex. True is certain, false is not.
bool are_clearly_apart(const Vec3& apex, const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& s) {
    // Coordinate differences are exact to half a unit in the last place, so a dot product of three terms is
    // wrong by less than 8 eps |x| |d|, with lengths in the maximum norm.
    constexpr double kMargin = 1e-14;
    const Vec3 a = p - apex, b = q - apex, c = r - apex, d = s - apex;
    const Vec3 direction = (a / a.norm() + b / b.norm()) - (c / c.norm() + d / d.norm());
    const double margin = kMargin * direction.lpNorm<1>();
    return a.dot(direction) > margin * a.lpNorm<1>() && b.dot(direction) > margin * b.lpNorm<1>() &&
           c.dot(direction) < -margin * c.lpNorm<1>() && d.dot(direction) < -margin * d.lpNorm<1>();
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

/// A triangle's bounding box, in the form CGAL's box intersection asks for. Its axes are those of space in
/// another order. In floats from the least corner of all on, rounded outwards: there are many.
struct TriangleBox {
    using NT = float;
    using ID = int;
    static int dimension() { return 3; }
    float min_coord(int axis) const { return low[axis]; }
    float max_coord(int axis) const { return high[axis]; }
    int id() const { return triangle; }

    float low[3], high[3];
    int triangle;
};

float rounded_down(double x) {
    const auto nearest = static_cast<float>(x);
    return nearest > x ? std::nextafter(nearest, -std::numeric_limits<float>::infinity()) : nearest;
}

float rounded_up(double x) {
    return -rounded_down(-x);
}

// Space is cut into slabs across its longest axis, so that threads can search them one by one. CGAL splits
// boxes along its axis 2, then 1, and scans along axis 0: with the thin side of the slabs on axis 1 a search
// costs 0.5 us per triangle, on axis 2 up to 2.
constexpr int kSlabAxis = 1;
constexpr std::size_t kSlabSize = 4096;               // boxes that begin in a slab, at most on average
constexpr std::size_t kFewest = 4, kLeastSlab = 512;  // slabs, unless they would have fewer boxes
constexpr std::ptrdiff_t kScanBelow = 100;  // boxes; splitting further costs more than comparing all

/// `order`: the axis of space that is each axis of the box.
TriangleBox boxed(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles, std::size_t t,
                  const Vec3& from, const std::array<int, 3>& order) {
    const Box box = box_of(points, triangles[t]);
    TriangleBox result;
    for (int k = 0; k < 3; ++k) {
        result.low[k] = rounded_down(box.min()[order[k]] - from[order[k]]);
        result.high[k] = rounded_up(box.max()[order[k]] - from[order[k]]);
    }
    result.triangle = static_cast<int>(t);
    return result;
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

/// The boxes of the triangles with area, those that begin in the same slab next to each other.
struct Slabs {
    Slabs(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles);

    std::size_t size() const { return earlier.size(); }
    auto begin_of(std::size_t slab) { return boxes.begin() + first[slab]; }
    auto end_of(std::size_t slab) { return boxes.begin() + first[slab + 1]; }

    std::vector<TriangleBox> boxes;
    std::vector<std::ptrdiff_t> first;              // of each slab, and the end
    std::vector<std::vector<TriangleBox>> earlier;  // that begin in a slab before and reach into this one
};

Slabs::Slabs(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles) {
    Box bounds;
    for (const Vec3& p : points) bounds.extend(p);
    int longest = 0;
    if (!bounds.isEmpty()) bounds.sizes().maxCoeff(&longest);
    std::array<int, 3> order;
    for (int k = 0; k < 3; ++k) order[k] = (longest + 3 + k - kSlabAxis) % 3;
    const auto box_at = [&](std::size_t t) { return boxed(points, triangles, t, bounds.min(), order); };

    constexpr std::size_t kEvery = 64;  // triangle of which one is a sample
    std::vector<float> sample;
    for (std::size_t t = 0; t < triangles.size(); t += kEvery) sample.push_back(box_at(t).low[kSlabAxis]);
    std::sort(sample.begin(), sample.end());
    const std::size_t wanted =
        std::max(triangles.size() / kSlabSize + 1, std::min(triangles.size() / kLeastSlab, kFewest));
    std::vector<float> begins;  // of all slabs but the first
    for (std::size_t k = 1; k < wanted; ++k) begins.push_back(sample[k * sample.size() / wanted]);

    // Which slab is found before there are boxes: to hold them twice would take the most memory of a frame.
    constexpr std::size_t kGrain = 1024;
    constexpr int kFlat = -1;
    std::vector<int> slab(triangles.size());
    std::vector<std::atomic<std::ptrdiff_t>> next(begins.size() + 1);
    parallel_for_each(triangles.size(), kGrain, [&](std::size_t t) {
        const auto& [i, j, k] = triangles[t];
        slab[t] = kFlat;
        if (!has_area(points[i], points[j], points[k])) return;
        slab[t] = static_cast<int>(std::upper_bound(begins.begin(), begins.end(), box_at(t).low[kSlabAxis]) -
                                   begins.begin());
        next[slab[t]].fetch_add(1, std::memory_order_relaxed);
    });
    first.assign(1, 0);
    for (auto& of_slab : next) first.push_back(first.back() + of_slab.exchange(first.back()));
    boxes.resize(first.back());
    parallel_for_each(triangles.size(), kGrain, [&](std::size_t t) {
        if (slab[t] != kFlat) boxes[next[slab[t]].fetch_add(1, std::memory_order_relaxed)] = box_at(t);
    });
    earlier.resize(next.size());
    for (std::size_t own = 0; own < size(); ++own)
        for (auto box = begin_of(own); box != end_of(own); ++box)
            for (std::size_t k = own; k < begins.size() && begins[k] <= box->high[kSlabAxis]; ++k)
                earlier[k + 1].push_back(*box);
}

}  // namespace

std::vector<std::pair<int, int>> self_intersections(const std::vector<Vec3>& points,
                                                    const std::vector<Triangle>& triangles) {
    // Two boxes that overlap do so in the slab where the second of them begins.
    check(points, triangles);
    Slabs slabs(points, triangles);
    std::vector<Pairs> found(slabs.size());
    tbb::parallel_for(std::size_t(0), slabs.size(), [&](std::size_t k) {
        auto& earlier = slabs.earlier[k];
        const auto test = [&](const TriangleBox& a, const TriangleBox& b) {
            if (cross(points, triangles[a.triangle], triangles[b.triangle]))
                found[k].push_back(std::minmax(a.triangle, b.triangle));
        };
        CGAL::box_self_intersection_d(slabs.begin_of(k), slabs.end_of(k), test, kScanBelow);
        CGAL::box_intersection_d(earlier.begin(), earlier.end(), slabs.begin_of(k), slabs.end_of(k), test,
                                 kScanBelow);
    });

    Pairs result;
    for (const Pairs& pairs : found) result.insert(result.end(), pairs.begin(), pairs.end());
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
    Box bounds;
    for (const Triangle& t : some) bounds.extend(box_of(points, t));
    const auto boxes_of = [&](const std::vector<Triangle>& triangles) {
        std::vector<TriangleBox> boxes;
        for (std::size_t t = 0; t < triangles.size(); ++t) {
            const auto& [i, j, k] = triangles[t];
            if (bounds.intersects(box_of(points, triangles[t])) && has_area(points[i], points[j], points[k]))
                boxes.push_back(boxed(points, triangles, t, bounds.min(), {0, 1, 2}));
        }
        return boxes;
    };
    std::vector<TriangleBox> ours = boxes_of(some), near = boxes_of(others);
    const int behind = static_cast<int>(others.size());  // CGAL takes boxes with one number for the same
    for (TriangleBox& box : ours) box.triangle += behind;
    CGAL::box_intersection_d(
        ours.begin(), ours.end(), near.begin(), near.end(),
        [&](const TriangleBox& a, const TriangleBox& b) {
            char& flag = crossed[b.triangle];
            flag = flag || cross(points, some[a.triangle - behind], others[b.triangle]);
        },
        kScanBelow);
    return crossed;
}

}  // namespace isotrack
