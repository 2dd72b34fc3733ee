// What one mesh of a frame has in common with the next: only facets near insertions come and go.
#pragma once

#include <array>
#include <vector>

#include "isotrack/meshing/manifold.h"

namespace isotrack {

/// A triangle by the cell and facet it is, and where its corners are.
struct Facet {
    int key;  ///< Ascending over a mesh but for halves of split triangles and triangles on a flipped
              ///< diagonal, which have -1 and equal nothing.
    std::array<Eigen::Vector3f, 3> corner;  ///< Vertices are rounded to floats before they are looked at.
    bool operator==(const Facet& o) const { return key >= 0 && key == o.key && corner == o.corner; }
};

/// One per triangle, in their order. `vertices` hold no more digits than floats.
std::vector<Facet> facets_of(const CarvedSurface& carved, const std::vector<Vec3>& vertices);

/// Calls `same` with the numbers of each facet that is in both, in `now` and in `before`; `came` with those
/// only in `now`, `went` with those only in `before`.
template <typename Same, typename Came, typename Went>
void compare(const std::vector<Facet>& now, const std::vector<Facet>& before, const Same& same,
             const Came& came, const Went& went) {
    std::size_t old = 0;
    for (std::size_t f = 0; f < now.size(); ++f) {
        while (now[f].key >= 0 && old < before.size() && before[old].key < now[f].key) went(old++);
        if (old < before.size() && now[f] == before[old])
            same(f, old++);
        else
            came(f);
    }
    while (old < before.size()) went(old++);
}

}  // namespace isotrack
