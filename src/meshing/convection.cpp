#include "isotrack/meshing/convection.h"

#include <tbb/parallel_for.h>

#include <cmath>
#include <cstddef>

#include "delaunay/circumcentre.h"
#include "isotrack/delaunay/predicates.h"
#include "numbers_below.h"
#include "surface/thread_probes.h"

namespace isotrack {
namespace {

constexpr char kOutside = 0, kInside = 1, kFlat = 2;
constexpr double kFar = 1.0;    // details: a centroid that far from the surface is on the side it says
constexpr double kClear = 0.5;  // length of the gradient: below it sheets are less than about a voxel apart

/// The facet through which the flow leaves a cell: the circumcentre lies beyond it. -1 when the cell holds
/// its circumcentre.
int flow_exit(const Tetrahedra& cells, const std::vector<Vec3>& points, int cell) {
    const auto& v = cells.vertices[cell];
    for (int k = 0; k < 4; ++k) {
        const auto& f = Tetrahedra::kFacet[k];
        if (in_diametral_ball(points[v[f[0]]], points[v[f[1]]], points[v[f[2]]], points[v[k]])) return k;
    }
    return -1;
}

}  // namespace

CellLabels guided_convection(const Tetrahedra& cells, const std::vector<Vec3>& points,
                             const std::vector<Vec3>& normals, const Surface& surface,
                             std::optional<double> detail) {
    CellLabels labels;
    update_labels(labels, numbers_below(cells.size()), cells, points, normals, surface, detail);
    return labels;
}

void update_labels(CellLabels& labels, const std::vector<int>& changed, const Tetrahedra& cells,
                   const std::vector<Vec3>& points, const std::vector<Vec3>& normals, const Surface& surface,
                   std::optional<double> detail) {
    labels.resize(cells.size(), kOutside);
    const double resolution = surface.resolution(), far = kFar * detail.value_or(resolution);
    ThreadProbes probes(surface);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, changed.size(), 512), [&](const auto& range) {
        Surface::Probe& probe = probes.local();
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            const int c = changed[i];
            const auto& v = cells.vertices[c];
            labels[c] = kOutside;
            if (cells.is_infinite(c)) continue;
            bool one_sheet = true;
            for (int a = 0; a < 4; ++a)
                for (int b = a + 1; b < 4; ++b)
                    one_sheet = one_sheet && normals[v[a]].dot(normals[v[b]]) >= 0.0;
            const Vec3& p0 = points[v[0]];
            const Vec3 e1 = points[v[1]] - p0, e2 = points[v[2]] - p0, e3 = points[v[3]] - p0;
            const Vec3 centroid = p0 + 0.25 * (e1 + e2 + e3);
            double value = probe.value(centroid);
            const double depth = std::abs(value);
            if (one_sheet && depth < far) {
                Vec3 centre;
                const bool flat = !circumcentre(e1, e2, e3, centre);
                const double at_centre = flat ? 0.0 : probe.value(p0 + centre);
                // How deep it is and whether sheets are near is dear, and matters only where the two do not
                // agree. Beyond the band of a grid there is no gradient.
                const auto is_in_doubt = [&] {
                    if (depth >= resolution) {
                        const double farther = std::abs(probe.farther_value(centroid));
                        if (farther >= far) return false;
                        if (farther > depth) return true;
                    }
                    return probe.sample(centroid).gradient.norm() > kClear;
                };
                if ((flat || (at_centre < 0.0) != (value < 0.0)) && is_in_doubt()) {
                    if (flat) {
                        labels[c] = kFlat;
                        continue;
                    }
                    value = at_centre;
                }
            }
            labels[c] = value < 0.0 ? kInside : kOutside;
        }
    });
    // Flat cells are rare; their flow ends at a cell that is not flat after a few steps, or it is cut off.
    constexpr int kLongestFlow = 64;
    for (const int c : changed) {
        if (labels[c] != kFlat) continue;
        int at = c;
        for (int step = 0; step < kLongestFlow && labels[at] == kFlat; ++step) {
            const int exit = flow_exit(cells, points, at);
            if (exit < 0) break;
            at = cells.neighbour(at, exit);
        }
        labels[c] = labels[at] == kInside ? kInside : kOutside;
    }
}

CellLabels pure_convection(const Tetrahedra& cells, const std::vector<Vec3>& points) {
    CellLabels labels(cells.size(), kInside);
    struct HalfFacet {
        int cell, k;  // seen from the carved cell
    };
    std::vector<HalfFacet> front;
    for (std::size_t c = 0; c < cells.size(); ++c)
        if (cells.is_infinite(static_cast<int>(c))) labels[c] = kOutside;
    for (std::size_t c = 0; c < cells.size(); ++c)
        if (labels[c] == kOutside)
            front.push_back(
                {static_cast<int>(c), cells.index_of(static_cast<int>(c), Tetrahedra::kInfinite)});
    while (!front.empty()) {
        const HalfFacet f = front.back();
        front.pop_back();
        const int inner = cells.neighbour(f.cell, f.k);
        if (labels[inner] == kOutside) continue;
        const auto& v = cells.vertices[inner];
        const int apex = cells.mirror_index(f.cell, f.k);
        const auto& facet = Tetrahedra::kFacet[apex];
        if (!in_diametral_ball(points[v[facet[0]]], points[v[facet[1]]], points[v[facet[2]]],
                               points[v[apex]]))
            continue;
        labels[inner] = kOutside;
        for (int k = 0; k < 4; ++k)
            if (k != apex) front.push_back({inner, k});
    }
    return labels;
}

}  // namespace isotrack
