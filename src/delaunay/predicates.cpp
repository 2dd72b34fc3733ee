#include "isotrack/delaunay/predicates.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>

#include <algorithm>
#include <array>
#include <tuple>

namespace isotrack {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
Kernel::Point_3 to_cgal(const Vec3& p) {
    return {p.x(), p.y(), p.z()};
}

}  // namespace

bool in_diametral_ball(const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& v) {
    return CGAL::side_of_bounded_sphere(to_cgal(p), to_cgal(q), to_cgal(r), to_cgal(v)) ==
           CGAL::ON_BOUNDED_SIDE;
}

int orientation(const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& s) {
    return static_cast<int>(CGAL::orientation(to_cgal(p), to_cgal(q), to_cgal(r), to_cgal(s)));
}

bool collinear(const Vec3& p, const Vec3& q, const Vec3& r) {
    return CGAL::collinear(to_cgal(p), to_cgal(q), to_cgal(r));
}

bool in_sphere(const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& s, const Vec3& v) {
    const auto side =
        CGAL::side_of_oriented_sphere(to_cgal(p), to_cgal(q), to_cgal(r), to_cgal(s), to_cgal(v));
    if (side != CGAL::ON_ORIENTED_BOUNDARY) return side == CGAL::ON_POSITIVE_SIDE;
    // The determinant is linear in the heights of the points on the paraboloid. The sign is that of the first
    // coefficient that is not 0, from the most lifted point on. That of v is the volume of pqrs, and lifting
    // v takes it out; that of another is the volume with v in its place.
    std::array<const Vec3*, 5> lifted{&p, &q, &r, &s, &v};
    std::sort(lifted.begin(), lifted.end(), [](const Vec3* a, const Vec3* b) {
        return std::tie(a->x(), a->y(), a->z()) > std::tie(b->x(), b->y(), b->z());
    });
    for (const Vec3* point : lifted) {
        if (point == &v) return false;
        const auto or_v = [&](const Vec3& own) -> const Vec3& { return &own == point ? v : own; };
        const int sign = orientation(or_v(p), or_v(q), or_v(r), or_v(s));
        if (sign != 0) return sign > 0;
    }
    return false;
}

}  // namespace isotrack
