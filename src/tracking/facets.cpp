#include "tracking/facets.h"

namespace isotrack {

std::vector<Facet> facets_of(const CarvedSurface& carved, const std::vector<Vec3>& vertices) {
    std::vector<Facet> facets;
    facets.reserve(carved.triangles.size());
    for (std::size_t t = 0; t < carved.triangles.size(); ++t) {
        const auto& [i, j, k] = carved.triangles[t];
        const bool whole = carved.inside_cell[t] >= 0 && carved.particle[i] >= 0 && carved.particle[j] >= 0 &&
                           carved.particle[k] >= 0;
        facets.push_back({whole ? 4 * carved.inside_cell[t] + carved.inside_facet[t] : -1,
                          {vertices[i].cast<float>(), vertices[j].cast<float>(), vertices[k].cast<float>()}});
    }
    return facets;
}

}  // namespace isotrack
