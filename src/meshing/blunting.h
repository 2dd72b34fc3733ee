// The ways to make a sharp triangle blunter.
#pragma once

#include <algorithm>
#include <functional>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "isotrack/meshing/blunting.h"
#include "meshing/corners.h"
#include "meshing/replacing.h"
#include "meshing/sharpness.h"
#include "meshing/triangle_boxes.h"

namespace isotrack {

/// A mesh in the course of a pass.
struct BluntedMesh : ReplaceableMesh {
    const Corners corners;  ///< Of the start; still right around what is untouched.
    const std::vector<char>& movable;
    const std::vector<char>& fixed;  ///< Per vertex: a move of it was taken back.
    const std::set<std::pair<int, int>>&
        lost;  ///< Edges, ascending, that may come back and are not to be made anew.
    std::function<const TriangleBoxes&()> boxes;  ///< Made when they are asked for: few are.
    std::vector<char> touched;                    ///< Per vertex: a change is near.

    double sharpness_of(const Triangle& t) const;
    double longest_edge_of(int triangle) const;
    /// Beside them is what was so when the pass began.
    Replaced replaced(const std::vector<int>& numbers, Surface::Probe& probe) const;
    /// The triangles but `except` (ascending) whose boxes meet this one.
    std::vector<Triangle> near(const Box& box, const std::vector<int>& except) const;
};

/// A change that may be made while the vertices it is about are untouched.
struct Proposal {
    Blunting change;
    std::vector<Triangle> after;     ///< A flip's two triangles.
    std::pair<int, int> lost{0, 0};  ///< The edge that it takes away, ascending.
    Vec3 to = Vec3::Zero();          ///< Where a vertex goes.
};

/// The largest cotangent that makes a change of triangles with this one worth it: a tenth less, or as little
/// as is wanted.
inline double worth(double before) {
    constexpr double kGain = 0.9;
    return std::max(kGain * before, kSharpnessAt30Degrees);
}

/// The other diagonal for the longest edge of a triangle with this cotangent.
std::optional<Proposal> flip(const BluntedMesh& mesh, int triangle, double sharpness, Surface::Probe& probe);

/// Another place for one of its corners, along the surface.
std::optional<Proposal> nudge(const BluntedMesh& mesh, int triangle, Surface::Probe& probe);

/// For what nothing cheaper helps: another place in space for one of its corners. Takes many times longer.
std::optional<Proposal> search(const BluntedMesh& mesh, int triangle, Surface::Probe& probe);

}  // namespace isotrack
