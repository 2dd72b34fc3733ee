#define CGAL_LINKED_WITH_TBB  // for what several threads sort
#include "delaunay/spatial_order.h"

#include <CGAL/hilbert_sort.h>
#include <CGAL/spatial_sort.h>

namespace isotrack {
namespace {

/// Points as CGAL sorts them: by coordinates, looked up by number.
struct ByNumber {
    using Point_3 = int;
    struct Less {
        const std::vector<Vec3>& points;
        int axis;
        bool operator()(int a, int b) const { return points[a][axis] < points[b][axis]; }
    };
    using Less_x_3 = Less;
    using Less_y_3 = Less;
    using Less_z_3 = Less;
    const std::vector<Vec3>& points;
    Less less_x_3_object() const { return {points, 0}; }
    Less less_y_3_object() const { return {points, 1}; }
    Less less_z_3_object() const { return {points, 2}; }
};

}  // namespace

void sort_spatially(const std::vector<Vec3>& points, std::vector<int>& order) {
    constexpr int kUsual = 0;  // of the fewest that are sorted, and of the fewest of a round
    CGAL::spatial_sort<CGAL::Parallel_tag>(order.begin(), order.end(), ByNumber{points},
                                           CGAL::Hilbert_sort_median_policy(), kUsual, kUsual, kRoundShare);
}

void sort_along_curve(const std::vector<Vec3>& points, std::vector<int>& order) {
    CGAL::hilbert_sort<CGAL::Parallel_tag>(order.begin(), order.end(), ByNumber{points});
}

}  // namespace isotrack
