#include "isotrack/meshing/certify.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "delaunay/circumcentre.h"

namespace isotrack {
namespace {

/// A triangle stands for a crossing when it faces the way the crossing leaves the inside, or nearly: the
/// surface itself always does.
constexpr double kFacing = -0.2;

/// Squared distance from p to triangle abc [Ericson 2005, "Real-Time Collision Detection", 5.1.5].
double squared_distance(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
    const Vec3 ab = b - a, ac = c - a, ap = p - a;
    const double d1 = ab.dot(ap), d2 = ac.dot(ap);
    if (d1 <= 0.0 && d2 <= 0.0) return ap.squaredNorm();
    const Vec3 bp = p - b;
    const double d3 = ab.dot(bp), d4 = ac.dot(bp);
    if (d3 >= 0.0 && d4 <= d3) return bp.squaredNorm();
    const double vc = d1 * d4 - d3 * d2;
    if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) return (ap - d1 / (d1 - d3) * ab).squaredNorm();
    const Vec3 cp = p - c;
    const double d5 = ab.dot(cp), d6 = ac.dot(cp);
    if (d6 >= 0.0 && d5 <= d6) return cp.squaredNorm();
    const double vb = d5 * d2 - d1 * d6;
    if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) return (ap - d2 / (d2 - d6) * ac).squaredNorm();
    const double va = d3 * d6 - d5 * d4;
    if (va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0)
        return (bp - (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b)).squaredNorm();
    const double sum = va + vb + vc;
    if (!(sum > 0.0)) return std::min({ap.squaredNorm(), bp.squaredNorm(), cp.squaredNorm()});
    return (ap - (vb / sum) * ab - (vc / sum) * ac).squaredNorm();
}

/// Follows the error uphill from a lattice point, by ever smaller steps in the triangle's barycentric
/// coordinates.
void climb(Surface::Probe& probe, const Vec3& a, const Vec3& ab, const Vec3& ac, double step, double& u,
           double& v, double& largest) {
    constexpr int kHalvings = 3;
    constexpr int kDirections[6][2] = {{1, 0}, {0, 1}, {-1, 1}, {-1, 0}, {0, -1}, {1, -1}};
    for (int halving = 0; halving < kHalvings; ++halving, step *= 0.5) {
        const double from_u = u, from_v = v;
        for (const auto& d : kDirections) {
            const double next_u = from_u + step * d[0], next_v = from_v + step * d[1];
            if (next_u < 0.0 || next_v < 0.0 || next_u + next_v > 1.0) continue;
            const double value = std::abs(probe.value(a + next_u * ab + next_v * ac));
            if (value <= largest) continue;
            largest = value;
            u = next_u;
            v = next_v;
        }
    }
}

}  // namespace

std::vector<TriangleError> triangle_errors(const std::vector<Vec3>& points,
                                           const std::vector<Triangle>& triangles, const Surface& surface,
                                           int steps, double refine_above) {
    std::vector<TriangleError> errors(triangles.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, triangles.size(), 64), [&](const auto& range) {
        const auto probe = surface.probe();
        for (std::size_t t = range.begin(); t < range.end(); ++t) {
            const Vec3 &a = points[triangles[t][0]], &b = points[triangles[t][1]],
                       &c = points[triangles[t][2]];
            TriangleError& error = errors[t];
            int count = 0;
            double best_u = 0.0, best_v = 0.0;
            for (int i = 0; i <= steps; ++i)
                for (int j = 0; i + j <= steps; ++j) {
                    const double u = static_cast<double>(i) / steps, v = static_cast<double>(j) / steps;
                    const double value = std::abs(probe->value(a + u * (b - a) + v * (c - a)));
                    error.mean_square += value * value;
                    ++count;
                    if (value <= error.largest) continue;
                    error.largest = value;
                    best_u = u;
                    best_v = v;
                }
            if (error.largest > refine_above)
                climb(*probe, a, b - a, c - a, 0.5 / steps, best_u, best_v, error.largest);
            error.where = a + best_u * (b - a) + best_v * (c - a);
            error.mean_square /= count;
        }
    });
    return errors;
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
    const int other = cells.neighbours[cell][facet];
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

std::vector<double> crossing_distances(const std::vector<Vec3>& points,
                                       const std::vector<Triangle>& triangles,
                                       const std::vector<Surface::Crossing>& crossings, double cutoff) {
    std::vector<double> result(crossings.size(), std::numeric_limits<double>::infinity());
    if (crossings.empty() || triangles.empty()) return result;

    // Triangles are entered into the cells of a grid that their box, widened by the cutoff, touches; a
    // crossing looks into its own cell.
    Box box;
    for (const auto& c : crossings) box.extend(c.point);
    double mean_edge = 0.0;
    for (const auto& t : triangles) mean_edge += (points[t[0]] - points[t[1]]).norm();
    const double cell_size = std::max(
        {mean_edge / static_cast<double>(triangles.size()), 2.0 * cutoff, box.diagonal().norm() * 1e-6});
    Eigen::Array<std::int64_t, 3, 1> size =
        (box.sizes() / cell_size).array().floor().cast<std::int64_t>() + 1;
    const auto cell_of = [&](const Vec3& p) {
        return Eigen::Array<std::int64_t, 3, 1>(
            ((p - box.min()) / cell_size).array().floor().cast<std::int64_t>());
    };
    const auto key_of = [&](std::int64_t x, std::int64_t y, std::int64_t z) {
        return (x * size[1] + y) * size[2] + z;
    };

    std::vector<Vec3> normals(triangles.size());
    for (std::size_t t = 0; t < triangles.size(); ++t) {
        const Vec3& a = points[triangles[t][0]];
        normals[t] = (points[triangles[t][1]] - a).cross(points[triangles[t][2]] - a).normalized();
    }

    struct Entry {
        std::int64_t key;
        int index;
        bool operator<(const Entry& o) const { return key < o.key || (key == o.key && index < o.index); }
    };
    std::vector<Entry> queries(crossings.size());
    for (std::size_t c = 0; c < crossings.size(); ++c) {
        const auto cell = cell_of(crossings[c].point).min(size - 1).max(0).eval();
        queries[c] = {key_of(cell[0], cell[1], cell[2]), static_cast<int>(c)};
    }
    std::sort(queries.begin(), queries.end());
    std::vector<std::int64_t> occupied;
    for (const Entry& q : queries)
        if (occupied.empty() || occupied.back() != q.key) occupied.push_back(q.key);

    std::vector<Entry> entries;
    for (std::size_t t = 0; t < triangles.size(); ++t) {
        Box reach;
        for (const int v : triangles[t]) reach.extend(points[v]);
        const auto low = cell_of(reach.min() - Vec3::Constant(cutoff)).max(0).eval();
        const auto high = cell_of(reach.max() + Vec3::Constant(cutoff)).min(size - 1).eval();
        for (std::int64_t x = low[0]; x <= high[0]; ++x)
            for (std::int64_t y = low[1]; y <= high[1]; ++y) {
                auto it = std::lower_bound(occupied.begin(), occupied.end(), key_of(x, y, low[2]));
                for (; it != occupied.end() && *it <= key_of(x, y, high[2]); ++it)
                    entries.push_back({*it, static_cast<int>(t)});
            }
    }
    std::sort(entries.begin(), entries.end());

    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, queries.size(), 256), [&](const auto& range) {
        for (std::size_t q = range.begin(); q < range.end(); ++q) {
            const Vec3& p = crossings[queries[q].index].point;
            const Vec3 outward = crossings[queries[q].index].outward.cast<double>();
            double least = std::numeric_limits<double>::infinity();
            auto it = std::lower_bound(entries.begin(), entries.end(), Entry{queries[q].key, -1});
            for (; it != entries.end() && it->key == queries[q].key; ++it) {
                const auto& t = triangles[it->index];
                if (normals[it->index].dot(outward) < kFacing) continue;
                least = std::min(least, squared_distance(p, points[t[0]], points[t[1]], points[t[2]]));
            }
            if (least <= cutoff * cutoff) result[queries[q].index] = std::sqrt(least);
        }
    });
    return result;
}

}  // namespace isotrack
