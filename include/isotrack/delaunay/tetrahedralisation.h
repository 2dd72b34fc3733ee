// The Delaunay tetrahedralisation (DT) of moving particles.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <vector>

#include "isotrack/sampling/adjacency.h"
#include "isotrack/types.h"

namespace isotrack {

/// A DT as flat arrays, for stages that only read it.
struct Tetrahedra {
    static constexpr int kInfinite = -1;  ///< The vertex that closes the hull.

    /// Vertex k of facet f of a cell, f being the index of the opposite vertex: counter-clockwise seen from
    /// outside the cell.
    static constexpr int kFacet[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};

    std::vector<std::array<int, 4>> vertices;  ///< Per cell; positively oriented; at most one is kInfinite.
    std::vector<std::array<int, 4>> links;     ///< Per cell, across the facet opposite vertex k: 4 n + m, for
                                               ///< cell n and the index m in it of the vertex across.

    std::size_t size() const { return vertices.size(); }
    static constexpr std::size_t kMostCells = std::size_t{1} << 29;  ///< That links can tell apart.
    /// An entry of `links`.
    static int link(int cell, int m) { return 4 * cell + m; }
    /// The cell across the facet opposite vertex k.
    int neighbour(int cell, int k) const { return links[cell][k] >> 2; }
    /// The index, in that one, of the vertex across the common facet.
    int mirror_index(int cell, int k) const { return links[cell][k] & 3; }
    bool is_infinite(int cell) const {
        const auto& v = vertices[cell];
        return v[0] < 0 || v[1] < 0 || v[2] < 0 || v[3] < 0;
    }
    /// The index k of `vertex` in `cell`, which must have it.
    int index_of(int cell, int vertex) const {
        const auto& v = vertices[cell];
        return v[0] == vertex ? 0 : v[1] == vertex ? 1 : v[2] == vertex ? 2 : 3;
    }
};

/// How a DT follows its points.
enum class UpdateStrategy {
    Rebuild,  ///< Changes are only noted; `settle` builds anew.
    Move,     ///< The paper's algorithm 3: a vertex moves in place when its star stays embedded and Delaunay,
              ///< else it is inserted anew, then removed from where it was. Exact after every call.
    Lazy,  ///< The paper's section 4.3: a vertex has a second position, in the DT, and follows its true one
           ///< only when that has broken the embedding (score 2 each) or the Delaunay property (score 1) up
           ///< to a score of 4.
    Auto   ///< Changes are only noted; `settle` does what is predicted to be cheaper: relocate what moved, or
           ///< build anew.
};
const char* name_of(UpdateStrategy strategy);

/// What the upkeep of a DT did since the first `assign`: the rows of the paper's table 1.
struct UpdateProfile {
    struct Row {
        std::size_t calls = 0;
        double seconds = 0.0;
    };
    Row build, remove, insert, locate, predicates;
    std::size_t relocated = 0;  ///< Vertices that were inserted anew and removed.
};

/// Points that move, come and go, and their DT. Vertices are numbered by the caller's order and keep their
/// number until `compact`. Between calls the DT may lag behind the points, as the strategy likes;
/// after `settle` it is exact. Not for concurrent use.
class Tetrahedralisation {
public:
    virtual ~Tetrahedralisation() = default;

    /// Starts anew with vertex i at points[i]. `threads`: so many add vertices at most, 0 for all that there
    /// are; the cells and their order are the same.
    virtual void assign(const std::vector<Vec3>& points, int threads = 0) = 0;
    /// Without vertices and cells, and frees their memory; the profile goes on. `assign` comes next.
    virtual void clear() = 0;
    /// Adds a vertex and returns its number: the count of vertices ever added. `near` is a vertex close by,
    /// or -1.
    virtual int insert(const Vec3& point, int near) = 0;
    virtual void move(int vertex, const Vec3& to) = 0;
    virtual void remove(int vertex) = 0;

    /// The vertices that share an edge with `vertex`, in no particular but reproducible order; for the
    /// strategies that only note changes as of the last `settle`.
    virtual void neighbours(int vertex, std::vector<int>& result) const = 0;

    /// Makes the DT that of the points where they are now; by all threads where it is built anew for that.
    virtual void settle() = 0;

    /// Settles, then numbers the vertices that are left anew: in their order, from 0. The cells keep their
    /// slots.
    virtual void compact() = 0;

    /// The cells as of the last `settle`, none when the points span no volume. A vertex on the very place of
    /// another belongs to no cell. A slot that lost its cell has only infinite vertices and is its own
    /// neighbour.
    virtual const Tetrahedra& cells() = 0;

    /// The slots of `cells()` that were written since the last call.
    virtual std::vector<int> take_changed() = 0;

    virtual const UpdateProfile& profile() const = 0;
};

std::unique_ptr<Tetrahedralisation> make_tetrahedralisation(UpdateStrategy strategy);

/// The DT of `points` at once. The order of the cells depends on the points alone.
Tetrahedra tetrahedralise(const std::vector<Vec3>& points);

/// Which of `count` vertices share an edge of the DT.
Adjacency vertex_adjacency(const Tetrahedra& cells, std::size_t count);

}  // namespace isotrack
