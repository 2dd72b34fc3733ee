#include "tracking/facets.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <utility>

namespace isotrack {

int facet_key(const CarvedSurface& carved, std::size_t triangle) {
    const auto& [i, j, k] = carved.triangles[triangle];
    const bool whole = carved.inside_cell[triangle] >= 0 && carved.particle[i] >= 0 &&
                       carved.particle[j] >= 0 && carved.particle[k] >= 0;
    return whole ? 4 * carved.inside_cell[triangle] + carved.inside_facet[triangle] : -1;
}

Facet MeshFacets::operator[](std::size_t triangle) const {
    const auto& [i, j, k] = carved_.triangles[triangle];
    return {facet_key(carved_, triangle),
            {vertices_[i].cast<float>(), vertices_[j].cast<float>(), vertices_[k].cast<float>()}};
}

void MeshFacets::write_to(std::vector<Facet>& facets) const {
    facets = std::vector<Facet>();  // first, as there are many
    facets.resize(size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, size(), 1024), [&](const auto& range) {
        for (std::size_t t = range.begin(); t < range.end(); ++t) facets[t] = (*this)[t];
    });
}

std::vector<std::array<std::size_t, 2>> same_corners(const std::vector<Facet>& came,
                                                     const std::vector<Facet>& went) {
    const auto coordinates = [](const Facet& f) {
        std::array<float, 9> result;
        for (int n = 0; n < 9; ++n) result[n] = f.corner[n / 3][n % 3];
        return result;
    };
    using Entry = std::pair<std::array<float, 9>, std::size_t>;
    const auto sorted = [&](const std::vector<Facet>& facets) {
        std::vector<Entry> entries;
        for (std::size_t i = 0; i < facets.size(); ++i) entries.emplace_back(coordinates(facets[i]), i);
        std::sort(entries.begin(), entries.end());
        return entries;
    };
    const std::vector<Entry> now = sorted(came), before = sorted(went);
    std::vector<std::array<std::size_t, 2>> result;
    for (auto n = now.begin(), b = before.begin(); n != now.end() && b != before.end();) {
        if (n->first < b->first)
            ++n;
        else if (b->first < n->first)
            ++b;
        else
            result.push_back({(n++)->second, (b++)->second});
    }
    return result;
}

}  // namespace isotrack
