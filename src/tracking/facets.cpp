#include "tracking/facets.h"

#include <tbb/parallel_for.h>

namespace isotrack {

std::vector<Facet> facets_of(const CarvedSurface& carved, const std::vector<Vec3>& vertices) {
    std::vector<Facet> facets(carved.triangles.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, facets.size(), 1024), [&](const auto& range) {
        for (std::size_t t = range.begin(); t < range.end(); ++t) {
            const auto& [i, j, k] = carved.triangles[t];
            const bool whole = carved.inside_cell[t] >= 0 && carved.particle[i] >= 0 &&
                               carved.particle[j] >= 0 && carved.particle[k] >= 0;
            facets[t] = {whole ? 4 * carved.inside_cell[t] + carved.inside_facet[t] : -1,
                         {vertices[i].cast<float>(), vertices[j].cast<float>(), vertices[k].cast<float>()}};
        }
    });
    return facets;
}

}  // namespace isotrack
