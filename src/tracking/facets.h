// What one mesh of a frame has in common with the next: only facets near insertions come and go.
#pragma once

#include <array>
#include <vector>

#include "isotrack/meshing/manifold.h"

namespace isotrack {

/// A triangle's facet, as `CarvedSurface::facet`: ascending over a mesh but for halves of split
/// triangles and those put in, which have -1.
int facet_key(const CarvedSurface& carved, std::size_t triangle);

/// A triangle by its `facet_key`, and where its corners are. With -1 it equals nothing; see `same_corners`.
struct Facet {
    int key;
    std::array<Eigen::Vector3f, 3> corner;  ///< Vertices are rounded to floats before they are looked at.
    Box box() const {
        Box result;
        for (const Eigen::Vector3f& c : corner) result.extend(c.cast<double>());
        return result;
    }
    bool operator==(const Facet& o) const { return key >= 0 && key == o.key && corner == o.corner; }
};

/// Those of a mesh, one per triangle, in their order; made when they are asked for, as there are many.
/// `vertices` hold no more digits than floats.
class MeshFacets {
public:
    MeshFacets(const CarvedSurface& carved, const std::vector<Vec3>& vertices)
        : carved_(carved), vertices_(vertices) {}
    std::size_t size() const { return carved_.triangles.size(); }
    Facet operator[](std::size_t triangle) const;

private:
    const CarvedSurface& carved_;
    const std::vector<Vec3>& vertices_;
};

/// The same when the mesh is another, in half of their memory.
class KeptFacets {
public:
    /// From now on those of this mesh, in the memory of those before where it is large enough.
    void assign(const CarvedSurface& carved, const std::vector<Vec3>& vertices);
    std::size_t size() const { return kept_.size(); }
    Facet operator[](std::size_t triangle) const {
        const auto& [key, corner] = kept_[triangle];
        return {key, {place_[corner[0]], place_[corner[1]], place_[corner[2]]}};
    }

private:
    struct Kept {
        int key;
        Triangle corner;
    };
    std::vector<Kept> kept_;
    std::vector<Eigen::Vector3f> place_;  // of each vertex
};

/// Calls `same` with the numbers of each facet that is in both, in `now` and in `before`; `came` with those
/// only in `now`, and what they are, `went` with those only in `before`. Of anything with a `facet_key`: both
/// ascend by it but for those that have -1, which must equal nothing.
template <typename Now, typename Before, typename Same, typename Came, typename Went>
void compare(const Now& now, const Before& before, const Same& same, const Came& came, const Went& went) {
    std::size_t old = 0;
    for (std::size_t f = 0; f < now.size(); ++f) {
        const auto facet = now[f];
        while (facet.key >= 0 && old < before.size() && before[old].key < facet.key) went(old++);
        if (old < before.size() && facet == before[old])
            same(f, old++);
        else
            came(f, facet);
    }
    while (old < before.size()) went(old++);
}

/// Of what came and went, which have no key, those that are the same after all, by their corners: pairs of
/// indices into both, in any order.
std::vector<std::array<std::size_t, 2>> same_corners(const std::vector<Facet>& came,
                                                     const std::vector<Facet>& went);

}  // namespace isotrack
