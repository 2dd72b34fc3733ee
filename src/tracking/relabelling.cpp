#include "tracking/relabelling.h"

#include <algorithm>
#include <limits>
#include <optional>

#include "isotrack/meshing/certify.h"
#include "tracking/cell_centroid.h"
#include "tracking/failing.h"

namespace isotrack {
namespace {

constexpr double kUnclear = 0.2;  // of the tolerance: a centroid so near does not tell the side
constexpr double kClose = 0.5;    // tolerances: a particle stands for what is missed so near

}  // namespace

std::size_t relabel(CellLabels& labels, const Tetrahedra& cells, const FrameMesh& mesh,
                    const Inspection& inspection, const Particles& particles, const Surface& surface,
                    const SizingLimits& limits) {
    const auto probe = surface.probe();
    std::size_t changed = 0;
    for (std::size_t t = 0; t < inspection.errors->size(); ++t) {
        const FacetError& error = (*inspection.errors)[t];
        const int inner = mesh.carved.inside_cell(t);
        if (!is_too_far(error, limits.tolerance) || inner < 0 || is_flipped(mesh.carved, t, cells)) continue;
        const bool outside = probe->value(error.where.cast<double>()) > 0.0;
        const int wrong = outside ? inner : cells.neighbour(inner, mesh.carved.inside_facet(t));
        if (cells.is_infinite(wrong) || labels[wrong] != static_cast<char>(outside)) continue;
        const double value = probe->value(centroid_of(wrong, cells, particles));
        if ((outside ? value : -value) < -kUnclear * limits.tolerance) continue;
        labels[wrong] = static_cast<char>(!outside);
        ++changed;
    }
    return changed;
}

std::size_t reach_out(CellLabels& labels, const Tetrahedra& cells, const FrameMesh& mesh,
                      const Inspection& inspection, const Particles& particles, const Surface& surface,
                      const SizingLimits& limits) {
    if (inspection.missed.empty()) return 0;
    const double tolerance = kCertified * limits.tolerance, close = kClose * limits.tolerance;
    std::vector<char> unused(particles.size(), 1);
    for (const int p : mesh.carved.particle)
        if (p >= 0) unused[p] = 0;
    struct Tip {
        int cell = -1, facet = 0;
        double error = std::numeric_limits<double>::infinity();
    };
    std::vector<std::optional<Tip>> tips(particles.size());
    for (std::size_t i = 0; i < particles.size(); ++i)
        if (unused[i] && std::any_of(inspection.missed.begin(), inspection.missed.end(), [&](const auto& c) {
                return (c.point - particles.position[i]).norm() < close;
            }))
            tips[i].emplace();
    const auto probe = surface.probe();
    for (std::size_t c = 0; c < cells.size(); ++c) {
        if (cells.is_infinite(static_cast<int>(c))) continue;
        const auto& v = cells.vertices[c];
        for (int k = 0; k < 4; ++k) {
            if (!tips[v[k]] || labels[c] == labels[cells.neighbour(static_cast<int>(c), k)]) continue;
            double error = 0.0;
            for (int side = 0; side < 4 && error <= tolerance; ++side) {
                if (side == k) continue;
                const auto& [i, j, l] = Tetrahedra::kFacet[side];
                error = std::max(error, certified_error(particles.position[v[i]], particles.position[v[j]],
                                                        particles.position[v[l]], *probe, limits.detail,
                                                        kSuspect * limits.tolerance, tolerance)
                                            .largest);
            }
            if (error <= tolerance && error < tips[v[k]]->error)
                *tips[v[k]] = {static_cast<int>(c), k, error};
        }
    }
    std::size_t changed = 0;
    for (const auto& tip : tips) {
        if (!tip || tip->cell < 0) continue;
        // Unless the cell behind its triangle just did.
        if (labels[tip->cell] == labels[cells.neighbour(tip->cell, tip->facet)]) continue;
        labels[tip->cell] = static_cast<char>(!labels[tip->cell]);
        ++changed;
    }
    return changed;
}

}  // namespace isotrack
