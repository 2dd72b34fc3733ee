#include "tracking/relabelling.h"

#include "tracking/failing.h"

namespace isotrack {
namespace {

constexpr double kUnclear = 0.2;  // of the tolerance: a centroid so near does not tell the side

}  // namespace

std::size_t relabel(CellLabels& labels, const Tetrahedra& cells, const FrameMesh& mesh,
                    const Inspection& inspection, const Particles& particles, const Surface& surface,
                    const SizingLimits& limits) {
    const auto probe = surface.probe();
    std::size_t changed = 0;
    for (std::size_t t = 0; t < inspection.errors->size(); ++t) {
        const TriangleError& error = (*inspection.errors)[t];
        const int inner = mesh.carved.inside_cell[t];
        if (!(error.largest > kCertified * limits.tolerance) || inner == CarvedSurface::kNoCell) continue;
        const bool outside = probe->value(error.where) > 0.0;
        const int wrong = outside ? inner : cells.neighbour(inner, mesh.carved.inside_facet[t]);
        if (cells.is_infinite(wrong) || labels[wrong] != static_cast<char>(outside)) continue;
        Vec3 centroid = Vec3::Zero();
        for (const int v : cells.vertices[wrong]) centroid += 0.25 * particles.position[v];
        const double value = probe->value(centroid);
        if ((outside ? value : -value) < -kUnclear * limits.tolerance) continue;
        labels[wrong] = static_cast<char>(!outside);
        ++changed;
    }
    return changed;
}

}  // namespace isotrack
