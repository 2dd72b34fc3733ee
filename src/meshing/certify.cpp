#include "isotrack/meshing/certify.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "atomic_extremes.h"
#include "delaunay/circumcentre.h"
#include "meshing/triangle_box.h"
#include "meshing/triangle_distance.h"
#include "meshing/triangle_quadratic.h"
#include "parallel_for_each.h"
#include "surface/thread_probes.h"

namespace isotrack {
namespace {

/// A triangle stands for a crossing when it faces the way the crossing leaves the inside, or nearly: the
/// surface itself always does.
constexpr double kStandsFor = -0.2;

constexpr int kFewestSteps = TriangleQuadratic::kFewestSteps, kMostSteps = TriangleQuadratic::kMostSteps;
constexpr double kSmooth = 0.05;  // of the error: residual of what is as good as a quadratic function
constexpr double kSteep = 0.3;    // of the steepest a distance can be
constexpr double kAlmost =
    1.4;  // times what is refined: a few points may have missed the larger of two maxima

/// A place in a triangle, by barycentric coordinates, and how far it is from the surface.
struct Sample {
    double u = 0.0, v = 0.0, distance = 0.0;
};

/// Follows the distance to one side of the surface (`sign`) uphill from a lattice point, by ever smaller
/// steps.
void climb(Surface::Probe& probe, const Vec3& a, const Vec3& ab, const Vec3& ac, double step, double sign,
           Sample& best) {
    constexpr double kLeastStep = 0.02;
    constexpr int kDirections[6][2] = {{1, 0}, {0, 1}, {-1, 1}, {-1, 0}, {0, -1}, {1, -1}};
    for (; step >= kLeastStep; step *= 0.5) {
        const Sample from = best;
        for (const auto& d : kDirections) {
            const double u = from.u + step * d[0], v = from.v + step * d[1];
            if (u < 0.0 || v < 0.0 || u + v > 1.0) continue;
            const double distance = sign * probe.farther_value(a + u * ab + v * ac);
            if (distance > best.distance) best = {u, v, distance};
        }
    }
}

/// The error at the points of a lattice, and how fast values change between those next to each other.
struct Survey {
    TriangleError error;
    double steepest = 0.0;
};

/// Looks for the farthest point to one side of the surface, from the farthest of a lattice: first at the peak
/// of a quadratic function where that is as good as the values, and uphill unless it is so there, too, and
/// stays below kAlmost `refine_above`.
void refine(Surface::Probe& probe, const Vec3& a, const Vec3& ab, const Vec3& ac, int steps, double sign,
            double refine_above, const std::optional<TriangleQuadratic>& quadratic, Sample& best) {
    const double close = kSmooth * best.distance;
    if (quadratic && quadratic->residual() < close) {
        const TriangleQuadratic::Point peak = quadratic->peak(sign);
        const double expected = sign * peak.value,
                     distance = sign * probe.farther_value(a + peak.u * ab + peak.v * ac);
        if (distance > best.distance) best = {peak.u, peak.v, distance};
        if (std::abs(distance - expected) < close && best.distance < kAlmost * refine_above) return;
    }
    climb(probe, a, ab, ac, 0.5 / steps, sign, best);
}

Survey survey(const Vec3& a, const Vec3& b, const Vec3& c, Surface::Probe& probe, int steps,
              double refine_above, double too_much = std::numeric_limits<double>::infinity()) {
    Survey result;
    TriangleError& error = result.error;
    Sample outside, inside;  // the farthest on either side
    const double along = steps / (c - a).norm(), across = steps / (b - a).norm();
    thread_local std::vector<Vec3> places;  // there are many triangles
    thread_local std::vector<double> values;
    places.clear();
    const auto for_each_point = [steps](const auto& visit) {
        for (int i = 0; i <= steps; ++i)
            for (int j = 0; i + j <= steps; ++j)
                visit(i, j, static_cast<double>(i) / steps, static_cast<double>(j) / steps);
    };
    // All are read first, by one call, so that a grid can fetch them together. A branch on the largest would
    // make the processor wait for each that is in no cache.
    for_each_point([&](int, int, double u, double v) { places.push_back(a + u * (b - a) + v * (c - a)); });
    values.resize(places.size());
    probe.farther_values(places.data(), places.size(), values.data());
    const double* next = values.data();
    for_each_point([&](int i, int j, double u, double v) {
        const double* const here = next++;
        const double value = *here;
        error.mean_square += value * value;
        if (value > outside.distance) outside = {u, v, value};
        if (-value > inside.distance) inside = {u, v, -value};
        const int row_before = steps + 2 - i;  // its length: so far back is what is next to a value
        if (i > 0) result.steepest = std::max(result.steepest, std::abs(value - here[-row_before]) * across);
        if (j > 0) result.steepest = std::max(result.steepest, std::abs(value - here[-1]) * along);
    });
    const bool may_do = std::max(outside.distance, inside.distance) <= too_much;
    std::optional<TriangleQuadratic> quadratic;
    if (may_do && std::max(outside.distance, inside.distance) > refine_above && steps >= kFewestSteps &&
        steps <= kMostSteps)
        quadratic.emplace(values.data(), steps);
    const auto refine_side = [&](double sign, Sample& farthest) {
        if (may_do && farthest.distance > refine_above)
            refine(probe, a, b - a, c - a, steps, sign, refine_above, quadratic, farthest);
    };
    refine_side(1.0, outside);
    refine_side(-1.0, inside);
    const Sample& farthest = outside.distance > inside.distance ? outside : inside;
    error.largest = farthest.distance;
    error.where = a + farthest.u * (b - a) + farthest.v * (c - a);
    error.mean_square /= static_cast<double>(values.size());
    return result;
}

}  // namespace

TriangleError triangle_error(const Vec3& a, const Vec3& b, const Vec3& c, Surface::Probe& probe, int steps,
                             double refine_above) {
    return survey(a, b, c, probe, steps, refine_above).error;
}

namespace {

/// `facing` of a triangle with this unit normal, where the gradient at the centroid is known.
double best_facing(const Vec3& normal, const Vec3& gradient, const Vec3& a, const Vec3& b, const Vec3& c,
                   Surface::Probe& probe) {
    const double length = gradient.norm();
    double most = length > 0.0 ? normal.dot(gradient) / length : 0.0;
    if (most >= kFacing) return most;
    for (const Vec3* corner : {&a, &b, &c}) most = std::max(most, normal.dot(probe.normal(*corner)));
    return most;
}

}  // namespace

double facing(const Vec3& a, const Vec3& b, const Vec3& c, Surface::Probe& probe) {
    return best_facing((b - a).cross(c - a).normalized(), probe.sample((a + b + c) / 3.0).gradient, a, b, c,
                       probe);
}

double turned_deg(const Vec3& a, const Vec3& b, const Vec3& c, Surface::Probe& probe, double detail) {
    constexpr double kLeastHeight = 0.5;  // details
    constexpr double kLeastSlope = 0.6;
    constexpr double kDegrees = 57.29577951308232;
    const double longest2 = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
    const double least = kLeastHeight * detail * std::sqrt(longest2);
    const Vec3 normal = (b - a).cross(c - a);
    const double twice_area = normal.norm();
    if (!(twice_area > least)) return 0.0;
    const Vec3 gradient = probe.sample((a + b + c) / 3.0).gradient;
    if (!(gradient.norm() > kLeastSlope)) return 0.0;
    const double cosine = best_facing(normal / twice_area, gradient, a, b, c, probe);
    return kDegrees * std::acos(std::clamp(cosine, -1.0, 1.0));
}

int error_steps(const Vec3& a, const Vec3& b, const Vec3& c, double detail) {
    const double longest2 = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
    const double wanted = std::ceil(std::sqrt(longest2) / detail);
    return static_cast<int>(std::clamp<double>(wanted, kFewestSteps, kMostSteps));
}

TriangleError certified_error(const Vec3& a, const Vec3& b, const Vec3& c, Surface::Probe& probe,
                              double detail, double refine_above, double too_much) {
    const int steps = error_steps(a, b, c, detail);
    auto [error, steepest] = survey(a, b, c, probe, steps, refine_above, too_much);
    if (error.largest > too_much) return error;
    if (steps < kMostSteps && (error.largest > kAlmost * refine_above || steepest > kSteep)) {
        const TriangleError again = survey(a, b, c, probe, kMostSteps, refine_above, too_much).error;
        if (again.largest > error.largest) error = again;
        if (error.largest > too_much) return error;
    }
    error.turned_deg = turned_deg(a, b, c, probe, detail);
    return error;
}

namespace {

/// `take` gets the number of each triangle abc and `error_of(a, b, c, probe)`.
template <typename ErrorOf, typename Take>
void measure(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles, const Surface& surface,
             const ErrorOf& error_of, const Take& take) {
    ThreadProbes probes(surface);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, triangles.size(), 64), [&](const auto& range) {
        Surface::Probe& probe = probes.local();
        for (std::size_t t = range.begin(); t < range.end(); ++t)
            take(t,
                 error_of(points[triangles[t][0]], points[triangles[t][1]], points[triangles[t][2]], probe));
    });
}

}  // namespace

std::vector<TriangleError> triangle_errors(const std::vector<Vec3>& points,
                                           const std::vector<Triangle>& triangles, const Surface& surface,
                                           int steps, double refine_above) {
    std::vector<TriangleError> errors(triangles.size());
    measure(
        points, triangles, surface, [&](auto&... at) { return triangle_error(at..., steps, refine_above); },
        [&](std::size_t t, const TriangleError& error) { errors[t] = error; });
    return errors;
}

std::vector<TriangleError> certified_errors(const std::vector<Vec3>& points,
                                            const std::vector<Triangle>& triangles, const Surface& surface,
                                            double detail, double refine_above) {
    std::vector<TriangleError> errors(triangles.size());
    certify_each(points, triangles, surface, detail, refine_above,
                 [&](std::size_t t, const TriangleError& error) { errors[t] = error; });
    return errors;
}

void certify_each(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                  const Surface& surface, double detail, double refine_above,
                  const std::function<void(std::size_t, const TriangleError&)>& take) {
    measure(
        points, triangles, surface, [&](auto&... at) { return certified_error(at..., detail, refine_above); },
        take);
}

std::optional<Vec3> dual_crossing(const Tetrahedra& cells, const std::vector<Vec3>& points, int cell,
                                  int facet, Surface::Probe& probe) {
    constexpr int kMostHalvings = 60;
    constexpr double kPrecision = 1e-7;  // of the facet's circumradius
    const auto centre_of = [&](int c, Vec3& centre) {
        const auto& v = cells.vertices[c];
        const Vec3& p = points[v[0]];
        if (!circumcentre(points[v[1]] - p, points[v[2]] - p, points[v[3]] - p, centre)) return false;
        centre += p;
        return true;
    };
    const auto& v = cells.vertices[cell];
    const Vec3 &a = points[v[Tetrahedra::kFacet[facet][0]]], u = points[v[Tetrahedra::kFacet[facet][1]]] - a,
               w = points[v[Tetrahedra::kFacet[facet][2]]] - a, normal = u.cross(w);
    const double length2 = normal.squaredNorm();
    if (!(length2 > 0.0)) return std::nullopt;
    // The dual edge is on the line middle + t axis.
    const Vec3 to_middle =
        (u.squaredNorm() * w.cross(normal) + w.squaredNorm() * normal.cross(u)) / (2.0 * length2);
    const Vec3 middle = a + to_middle, axis = normal / std::sqrt(length2);
    Vec3 inner, outer;
    if (!centre_of(cell, inner)) return std::nullopt;
    const double low = (inner - middle).dot(axis);
    const int other = cells.neighbour(cell, facet);
    double high = std::max(low, 0.0) + to_middle.norm();
    if (!cells.is_infinite(other)) {
        if (!centre_of(other, outer)) return std::nullopt;
        high = (outer - middle).dot(axis);
    }
    const double start = std::clamp(0.0, std::min(low, high), std::max(low, high));
    const auto value = [&](double t) { return probe.value(middle + t * axis); };
    const bool start_inside = value(start) < 0.0;
    double inside = start_inside ? start : low, outside = start_inside ? high : start;
    if (!(value(inside) < 0.0) || value(outside) < 0.0) return std::nullopt;
    const double close = kPrecision * to_middle.norm();
    for (int halving = 0; halving < kMostHalvings && std::abs(outside - inside) > close; ++halving) {
        const double t = 0.5 * (inside + outside);
        (value(t) < 0.0 ? inside : outside) = t;
    }
    return middle + 0.5 * (inside + outside) * axis;
}

namespace {

/// The least squared distance that several threads find, rounded to a float; infinite at first. Rounding
/// keeps the order, so that who finds it first changes nothing.
class LeastSquare {
public:
    float get() const { return value_.load(std::memory_order_relaxed); }
    void take(double square) { lower_to(value_, static_cast<float>(square)); }

private:
    std::atomic<float> value_{std::numeric_limits<float>::infinity()};
};

}  // namespace

FacingTriangle::FacingTriangle(const Vec3& a, const Vec3& b, const Vec3& c)
    : corner_{a, b, c}, normal_((b - a).cross(c - a).normalized()) {
    constexpr double kFlat = 1e-12;  // twice the area, of the longest edge squared: its normal is rounding
    const double longest2 = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
    const bool flat = !((b - a).cross(c - a).norm() > kFlat * longest2);
    for (int k = 0; k < 3; ++k) {
        out_[k] = flat ? Vec3(Vec3::Zero()) : (corner_[(k + 1) % 3] - corner_[k]).cross(normal_);
        length2_[k] = out_[k].squaredNorm();
    }
}

double FacingTriangle::squared_distance(const Surface::Crossing& crossing, double limit) const {
    constexpr double kInfinite = std::numeric_limits<double>::infinity();
    constexpr double kRounding = 1e-9;  // ample: what is as far as the limit is measured
    const double off_plane = normal_.dot(crossing.point - corner_[0]), off_plane2 = off_plane * off_plane;
    if (off_plane2 > limit || normal_.dot(crossing.outward.cast<double>()) < kStandsFor) return kInfinite;
    bool over = true;  // the triangle, and not one without area
    for (int k = 0; k < 3; ++k) {
        const double out = out_[k].dot(crossing.point - corner_[k]);  // times the length of the edge
        if (out > 0.0 && out * out > ((1.0 + kRounding) * limit - off_plane2) * length2_[k]) return kInfinite;
        over = over && out < 0.0;
    }
    if (over) return off_plane2;
    return isotrack::squared_distance(crossing.point, corner_[0], corner_[1], corner_[2]);
}

namespace {

/// The distances that are at most `reach`; the others are infinite.
std::vector<float> distances_within(double reach, const std::vector<Vec3>& points,
                                    const std::vector<Triangle>& triangles, const CrossingGrid& grid) {
    constexpr std::size_t kTriangles = 64, kCrossings = 16384;  // a thread's at least
    std::vector<LeastSquare> least(grid.size());
    const Vec3 around = Vec3::Constant(reach);
    parallel_for_each(triangles.size(), kTriangles, [&](std::size_t t) {
        const Vec3 &a = points[triangles[t][0]], &b = points[triangles[t][1]], &c = points[triangles[t][2]];
        std::optional<FacingTriangle> triangle;  // where crossings are few, most are far from all
        const Box box = box_of(points, triangles[t]);
        grid.for_each_in(Box(box.min() - around, box.max() + around), [&](std::size_t i) {
            if (!triangle) triangle.emplace(a, b, c);
            const double limit = std::min<double>(reach * reach, least[i].get());
            least[i].take(triangle->squared_distance(grid[i], limit));
        });
    });
    std::vector<float> distances(grid.size());
    parallel_for_each(grid.size(), kCrossings, [&](std::size_t i) {
        const float square = least[i].get();
        distances[i] = square > static_cast<float>(reach * reach) ? std::numeric_limits<float>::infinity()
                                                                  : std::sqrt(square);
    });
    return distances;
}

/// The distances of some crossings, found by `measure` of their grid, into their entries.
template <typename Measure>
void measure_some(const CrossingGrid& grid, std::vector<int> some, const Measure& measure,
                  std::vector<float>& distances) {
    if (some.empty()) return;
    const std::vector<float> found = measure(grid.some(some));
    for (std::size_t i = 0; i < some.size(); ++i) distances[some[i]] = found[i];
}

}  // namespace

void crossing_distances(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                        const CrossingGrid& grid, std::vector<int> some, double cutoff,
                        std::vector<float>& distances) {
    const auto measure = [&](const CrossingGrid& few) {
        return crossing_distances(points, triangles, few, cutoff);
    };
    measure_some(grid, std::move(some), measure, distances);
}

std::vector<float> crossing_distances(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                                      const CrossingGrid& grid, double cutoff) {
    constexpr double kNear = 0.4;  // of the cutoff: most are
    std::vector<float> distances = distances_within(kNear * cutoff, points, triangles, grid);
    std::vector<int> left;
    for (std::size_t i = 0; i < distances.size(); ++i)
        if (std::isinf(distances[i])) left.push_back(static_cast<int>(i));
    const auto measure = [&](const CrossingGrid& far) {
        return distances_within(cutoff, points, triangles, far);
    };
    measure_some(grid, std::move(left), measure, distances);
    return distances;
}

}  // namespace isotrack
