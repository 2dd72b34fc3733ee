#include "isotrack/compare/metrics.h"

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Simple_cartesian.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>

#include "isotrack/meshing/certify.h"
#include "isotrack/meshing/self_intersections.h"

namespace isotrack {
namespace {

constexpr double kDegrees = 57.295779513082320876798154814105;
constexpr int kLatticeSteps = 6;  // per edge of a triangle: 28 points
// Fixed, because it decides where sums are cut: the same bits at any thread count.
constexpr std::size_t kGrain = 256;

/// Largest value, and the root of the weighted mean square.
struct Spread {
    double largest = 0.0, squares = 0.0, weight = 0.0;

    void add(double value, double square, double w) {
        largest = std::max(largest, value);
        squares += w * square;
        weight += w;
    }
    Spread operator+(const Spread& b) const {
        return {std::max(largest, b.largest), squares + b.squares, weight + b.weight};
    }
    double rms() const { return weight > 0.0 ? std::sqrt(squares / weight) : 0.0; }
};

/// Sums what `body(range, sum)` adds up; the order of the sum does not depend on the number of threads.
template <class Sum, class Body>
Sum reduce(std::size_t size, const Body& body) {
    return tbb::parallel_deterministic_reduce(
        tbb::blocked_range<std::size_t>(0, size, kGrain), Sum{},
        [&](const tbb::blocked_range<std::size_t>& range, Sum sum) {
            body(range, sum);
            return sum;
        },
        std::plus<>());
}

/// Normal times area.
Vec3 area_vector(const TriangleMesh& mesh, const Triangle& t) {
    return 0.5 * (mesh.points[t[1]] - mesh.points[t[0]]).cross(mesh.points[t[2]] - mesh.points[t[0]]);
}

Spread distance_to_surface(const TriangleMesh& mesh, const LevelSet& level_set) {
    const std::vector<TriangleError> errors =
        triangle_errors(mesh.points, mesh.triangles, level_set, kLatticeSteps);
    return reduce<Spread>(errors.size(), [&](const auto& range, Spread& sum) {
        for (std::size_t i = range.begin(); i != range.end(); ++i)
            sum.add(errors[i].largest, errors[i].mean_square, area_vector(mesh, mesh.triangles[i]).norm());
    });
}

/// The crossings, moved onto the surface.
std::vector<Vec3> surface_points(const LevelSet& level_set) {
    const std::vector<Surface::Crossing> crossings = level_set.crossings();
    std::vector<Vec3> points(crossings.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, points.size(), kGrain),
                      [&](const tbb::blocked_range<std::size_t>& range) {
                          const auto probe = level_set.probe();
                          for (std::size_t i = range.begin(); i != range.end(); ++i)
                              points[i] = probe->project(crossings[i].point).value_or(crossings[i].point);
                      });
    return points;
}

Spread distance_to_mesh(const TriangleMesh& mesh, const LevelSet& level_set) {
    // Distances are rounded anyway: plain doubles do, and are several times faster than an exact kernel.
    using Kernel = CGAL::Simple_cartesian<double>;
    using Triangles = std::vector<Kernel::Triangle_3>;
    using Primitive = CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>;
    using Tree = CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>>;
    const auto to_cgal = [](const Vec3& p) { return Kernel::Point_3(p.x(), p.y(), p.z()); };

    const std::vector<Vec3> points = surface_points(level_set);
    Triangles
        triangles;  // those with area: CGAL cannot project on the others, whose place their neighbours share
    for (const Triangle& t : mesh.triangles)
        if (area_vector(mesh, t).squaredNorm() > 0.0)
            triangles.emplace_back(to_cgal(mesh.points[t[0]]), to_cgal(mesh.points[t[1]]),
                                   to_cgal(mesh.points[t[2]]));
    if (points.empty()) return {};
    if (triangles.empty()) {
        const double infinity = std::numeric_limits<double>::infinity();
        return {infinity, infinity, 1.0};
    }

    Tree tree(triangles.begin(), triangles.end());
    // A k-d tree of the vertices would find where to begin; the last answer is closer and costs nothing.
    tree.do_not_accelerate_distance_queries();
    tree.build();
    return reduce<Spread>(points.size(), [&](const auto& range, Spread& sum) {
        // Crossings come in lattice order: the point nearest to the last one is a tight bound for the next.
        Kernel::Point_3 nearest = triangles.front()[0];
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
            const Kernel::Point_3 query = to_cgal(points[i]);
            nearest = tree.closest_point(query, nearest);
            const double square = CGAL::squared_distance(query, nearest);
            sum.add(std::sqrt(square), square, 1.0);
        }
    });
}

/// Angle between facet normal and surface normal: the largest, and its mean weighted by area.
struct Deviation {
    double largest = 0.0, sum = 0.0, weight = 0.0;

    Deviation operator+(const Deviation& b) const {
        return {std::max(largest, b.largest), sum + b.sum, weight + b.weight};
    }
    double mean() const { return weight > 0.0 ? sum / weight : 0.0; }
};

Deviation normal_deviation(const TriangleMesh& mesh, const LevelSet& level_set) {
    return reduce<Deviation>(mesh.triangles.size(), [&](const auto& range, Deviation& sum) {
        const auto probe = level_set.probe();
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
            const Triangle& t = mesh.triangles[i];
            const Vec3 facet = area_vector(mesh, t);
            const Vec3 normal =
                probe->normal((mesh.points[t[0]] + mesh.points[t[1]] + mesh.points[t[2]]) / 3.0);
            const double area = facet.norm();
            if (!(area > 0.0) || normal.isZero()) continue;
            const double angle = std::atan2(facet.cross(normal).norm(), facet.dot(normal)) * kDegrees;
            sum.largest = std::max(sum.largest, angle);
            sum.sum += area * angle;
            sum.weight += area;
        }
    });
}

}  // namespace

MeshMetrics measure(const TriangleMesh& mesh, const LevelSet& level_set) {
    MeshMetrics result;
    result.topology = mesh_topology(mesh);  // first, because it refuses what the rest relies on
    result.self_intersections = self_intersections(mesh).size();
    result.volume = enclosed_volume(mesh);

    const double voxel = level_set.voxel_size();
    const Spread to = distance_to_surface(mesh, level_set);
    result.to_max = to.largest / voxel;
    result.to_rms = to.rms() / voxel;
    const Spread from = distance_to_mesh(mesh, level_set);
    result.from_max = from.largest / voxel;
    result.from_rms = from.rms() / voxel;

    const Deviation deviation = normal_deviation(mesh, level_set);
    result.normal_max_deg = deviation.largest;
    result.normal_mean_deg = deviation.mean();

    std::vector<double> angles = smallest_angles(mesh);
    if (!angles.empty()) {
        result.mean_min_angle_deg =
            std::accumulate(angles.begin(), angles.end(), 0.0) / static_cast<double>(angles.size());
        const auto percentile = angles.begin() + static_cast<std::ptrdiff_t>(angles.size() / 100);
        std::nth_element(angles.begin(), percentile, angles.end());
        result.angle_p1_deg = *percentile;
        result.min_angle_deg = *std::min_element(angles.begin(), percentile + 1);
    }
    return result;
}

}  // namespace isotrack
