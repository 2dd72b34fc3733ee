#include "tracking/facets.h"

#include <tbb/parallel_for.h>

namespace isotrack {

Facet MeshFacets::operator[](std::size_t triangle) const {
    const auto& [i, j, k] = carved_.triangles[triangle];
    const bool whole = carved_.inside_cell[triangle] >= 0 && carved_.particle[i] >= 0 &&
                       carved_.particle[j] >= 0 && carved_.particle[k] >= 0;
    return {whole ? 4 * carved_.inside_cell[triangle] + carved_.inside_facet[triangle] : -1,
            {vertices_[i].cast<float>(), vertices_[j].cast<float>(), vertices_[k].cast<float>()}};
}

void MeshFacets::write_to(std::vector<Facet>& facets) const {
    facets = std::vector<Facet>();  // first, as there are many
    facets.resize(size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, size(), 1024), [&](const auto& range) {
        for (std::size_t t = range.begin(); t < range.end(); ++t) facets[t] = (*this)[t];
    });
}

}  // namespace isotrack
