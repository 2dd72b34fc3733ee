// What one mesh of a frame has in common with the next: only facets near insertions come and go.
#pragma once

#include <tbb/parallel_for.h>

#include <array>
#include <cstddef>
#include <utility>
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

/// What is in one of two meshes alone: numbers, ascending.
struct FacetDifference {
    std::vector<std::size_t> came, went;
};

/// Calls `same` with the numbers of each facet that is in both, in `now` and in `before`, from several
/// threads; returns the others. Of anything with a `facet_key`: both ascend by it but for those that have -1,
/// which must equal nothing.
template <typename Now, typename Before, typename Same>
FacetDifference compare(const Now& now, const Before& before, const Same& same) {
    constexpr std::size_t kBlock = 4096;
    /// A place in `before` ahead of which all keys are lower than this one, and behind which none is.
    const auto place_of = [&](int key) {
        std::size_t low = 0, high = before.size();
        while (low < high) {
            const std::size_t middle = low + (high - low) / 2;
            std::size_t keyed = middle;
            while (keyed < high && before[keyed].key < 0) ++keyed;
            if (keyed < high && before[keyed].key < key)
                low = keyed + 1;
            else
                high = middle;
        }
        return low;
    };
    struct Start {
        std::size_t now, before;
    };
    std::vector<Start> starts{{0, 0}};  // of blocks, and the end
    for (std::size_t f = kBlock; f < now.size(); f += kBlock) {
        while (f < now.size() && now[f].key < 0) ++f;
        if (f < now.size()) starts.push_back({f, place_of(now[f].key)});
    }
    std::vector<FacetDifference> blocks(starts.size());
    starts.push_back({now.size(), before.size()});
    tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t b) {
        const Start end = starts[b + 1];
        auto& [came, went] = blocks[b];
        std::size_t old = starts[b].before;
        for (std::size_t f = starts[b].now; f < end.now; ++f) {
            const auto facet = now[f];
            while (facet.key >= 0 && old < end.before && before[old].key < facet.key) went.push_back(old++);
            if (old < end.before && facet == before[old])
                same(f, old++);
            else
                came.push_back(f);
        }
        while (old < end.before) went.push_back(old++);
    });
    FacetDifference result = std::move(blocks.front());
    for (std::size_t b = 1; b < blocks.size(); ++b) {
        result.came.insert(result.came.end(), blocks[b].came.begin(), blocks[b].came.end());
        result.went.insert(result.went.end(), blocks[b].went.begin(), blocks[b].went.end());
    }
    return result;
}

/// Of what came and went, which have no key, those that are the same after all, by their corners: pairs of
/// indices into both, in any order.
std::vector<std::array<std::size_t, 2>> same_corners(const std::vector<Facet>& came,
                                                     const std::vector<Facet>& went);

}  // namespace isotrack
