#include "tracking/refinement.h"

#include <algorithm>
#include <array>

#include "isotrack/meshing/certify.h"
#include "tracking/failing.h"

namespace isotrack {
namespace {

/// By an inside cell and the index of its vertex that is opposite.
using BoundaryFacet = std::array<int, 2>;

/// The boundary facets of some cells, ascending.
std::vector<BoundaryFacet> boundary_of(const std::vector<int>& some, const Tetrahedra& cells,
                                       const CellLabels& labels) {
    std::vector<BoundaryFacet> facets;
    for (const int c : some)
        for (int k = 0; k < 4; ++k) {
            const int other = cells.neighbour(c, k);
            if (labels[c] && !labels[other]) facets.push_back({c, k});
            if (!labels[c] && labels[other]) facets.push_back({other, cells.mirror_index(c, k)});
        }
    std::sort(facets.begin(), facets.end());
    facets.erase(std::unique(facets.begin(), facets.end()), facets.end());
    return facets;
}

}  // namespace

void refine(Tetrahedralisation& dt, CellLabels& labels, Particles& particles, Densifier& densifier,
            const Surface& surface, const SizingLimits& limits) {
    constexpr int kMostRounds = 24;
    const auto probe = surface.probe();
    for (int round = 0; round < kMostRounds; ++round) {
        const Tetrahedra& cells = dt.cells();
        const std::vector<int> changed = dt.take_changed();
        update_labels(labels, changed, cells, particles.position, particles.normal, surface, limits.detail);
        const std::vector<BoundaryFacet> facets = boundary_of(changed, cells, labels);
        std::vector<Triangle> triangles;
        for (const auto& [cell, k] : facets) {
            const auto& v = cells.vertices[cell];
            const auto& f = Tetrahedra::kFacet[k];
            triangles.push_back({v[f[0]], v[f[1]], v[f[2]]});
        }
        const auto errors = certified_errors(particles.position, triangles, surface, limits.detail,
                                             kSuspect * limits.tolerance);
        std::vector<Shortage> shortages;
        for (std::size_t f = 0; f < facets.size(); ++f) {
            if (!is_too_far(errors[f], limits.tolerance) && !is_turned(errors[f]) &&
                !is_needle(particles, triangles[f], limits.detail))
                continue;
            const auto x = dual_crossing(cells, particles.position, facets[f][0], facets[f][1], *probe);
            if (x) shortages.push_back({*x, (*x - particles.position[triangles[f][0]]).norm()});
        }
        const std::size_t before = particles.size();
        if (densifier.add(shortages) == 0) return;
        for (std::size_t i = before; i < particles.size(); ++i) dt.insert(particles.position[i], -1);
        dt.settle();
    }
}

}  // namespace isotrack
