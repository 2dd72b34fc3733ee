#include "tracking/facets.h"

#include <algorithm>
#include <utility>

#include "parallel_for_each.h"

namespace isotrack {

int facet_key(const CarvedSurface& carved, std::size_t triangle) {
    const auto& [i, j, k] = carved.triangles[triangle];
    const bool whole = carved.particle[i] >= 0 && carved.particle[j] >= 0 && carved.particle[k] >= 0;
    return whole ? carved.facet[triangle] : CarvedSurface::kNoFacet;
}

Facet MeshFacets::operator[](std::size_t triangle) const {
    const auto& [i, j, k] = carved_.triangles[triangle];
    return {facet_key(carved_, triangle),
            {vertices_[i].cast<float>(), vertices_[j].cast<float>(), vertices_[k].cast<float>()}};
}

void KeptFacets::assign(const CarvedSurface& carved, const std::vector<Vec3>& vertices) {
    kept_.resize(carved.triangles.size());
    place_.resize(vertices.size());
    constexpr std::size_t kGrain = 1024;
    parallel_for_each(kept_.size(), kGrain, [&](std::size_t t) {
        kept_[t] = {facet_key(carved, t), carved.triangles[t]};
    });
    parallel_for_each(place_.size(), kGrain, [&](std::size_t v) { place_[v] = vertices[v].cast<float>(); });
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
