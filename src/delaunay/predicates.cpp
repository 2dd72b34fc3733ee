#include "isotrack/delaunay/predicates.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>

namespace isotrack {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
Kernel::Point_3 to_cgal(const Vec3& p) { return {p.x(), p.y(), p.z()}; }

}  // namespace

bool in_diametral_ball(const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& v) {
    return CGAL::side_of_bounded_sphere(to_cgal(p), to_cgal(q), to_cgal(r), to_cgal(v)) == CGAL::ON_BOUNDED_SIDE;
}

int orientation(const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& s) {
    return static_cast<int>(CGAL::orientation(to_cgal(p), to_cgal(q), to_cgal(r), to_cgal(s)));
}

}  // namespace isotrack
