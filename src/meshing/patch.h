// A part of a mesh exchanged for that of another mesh of the same surface.
#pragma once

#include <atomic>
#include <optional>
#include <vector>

#include "isotrack/types.h"
#include "meshing/triangle_tree.h"

namespace isotrack {

/// Normal to a triangle, of twice the length of its area.
Vec3 area_vector(const Triangle& t, const std::vector<Vec3>& at);

/// What goes and what comes.
struct Patch {
    std::vector<int> gone;            ///< Triangles of the mesh, ascending.
    std::vector<Vec3> points;         ///< Numbered on from those of the mesh: all that come are among them.
    std::vector<Triangle> triangles;  ///< That come.
    long components = 0, euler = 0;   ///< How much more of them there are in what comes than in what goes.
};

/// The mesh that patches come from. It remembers what it finds of the one they are for. Threads may share it,
/// but for `look_at`.
class PatchSource {
public:
    /// `spacing`: the length of an edge, > 0. Closed and manifold around what will go. It takes less time
    /// where triangles that follow each other are near each other.
    PatchSource(TriangleMesh mesh, double spacing);
    PatchSource(const PatchSource&) = delete;
    PatchSource& operator=(const PatchSource&) = delete;

    double spacing() const { return spacing_; }
    const TriangleTree& tree() const { return tree_; }
    const Vec3& normal(int vertex) const { return normal_[vertex]; }  ///< Unit, or zero.

    /// From now on patches are for this mesh, which must outlive that.
    void look_at(const TriangleTree& mesh);
    bool looks_at(const TriangleTree& mesh) const { return looked_at_ == &mesh; }
    /// Finds, by several threads, for each of some vertices the triangle of that mesh that is nearest, among
    /// those that face the same way if one of them is within two spacings; -1 if there is none.
    void look_beside(const std::vector<int>& vertices);
    int beside(int vertex) const { return beside_[vertex].load(std::memory_order_relaxed); }  ///< As found.

private:
    void forget();

    TriangleMesh mesh_;
    double spacing_;
    TriangleTree tree_;
    std::vector<Vec3> normal_;
    std::vector<std::atomic<int>> beside_;  // whoever looks finds the same
    const TriangleTree* looked_at_ = nullptr;
};

/// The triangles of a mesh within `reach` of a place, and those around where their border would be pinched.
/// Ascending.
std::vector<int> triangles_around(const Vec3& place, double reach, const TriangleTree& mesh);

/// Whether some triangles of a mesh have as many components, loops of their border, and handles as some of
/// another. Their borders must be pinched nowhere.
bool have_same_numbers(const std::vector<int>& some, const TriangleTree& mesh, const std::vector<int>& others,
                       const TriangleTree& other_mesh);

/// `gone`, ascending, with a border that is pinched nowhere, goes. The triangles of `source` that are nearest
/// to them come, less a seam about as wide as its spacing; strips of triangles that face as the source does,
/// if any do, fill the seam from each loop of the one border to one of the other, and what they cross of what
/// comes is left out. nullopt where the loops do not match. The mesh must be closed and manifold, and so is
/// what it becomes, but for edges that it may have twice; it may cross itself. `source` must look at it.
std::optional<Patch> patch_for(const std::vector<int>& gone, const TriangleTree& mesh, PatchSource& source);

/// Whether a closed, oriented manifold stays one with a patch: around each vertex of what comes and of what
/// goes, ascending, the triangles that come and those that stay are one closed fan, or there are none.
bool stays_manifold(const Patch& patch, const TriangleTree& mesh);

}  // namespace isotrack
