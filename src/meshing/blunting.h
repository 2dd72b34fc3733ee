// The two ways to make a sharp triangle blunter.
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "isotrack/meshing/blunting.h"
#include "isotrack/meshing/certify.h"
#include "meshing/corners.h"
#include "meshing/sharpness.h"
#include "meshing/triangle_boxes.h"

namespace isotrack {

/// What a change would replace.
struct Replaced {
    double facing;  ///< The least cosine between normals of its triangles and the surface's.
    std::vector<FacingTriangle> triangles;
    std::vector<FacingTriangle> beside;  ///< With a vertex in common when the pass began.
    Box box;
};

/// A mesh in the course of a pass.
struct BluntedMesh {
    std::vector<Vec3>& points;
    std::vector<Triangle>& triangles;
    const Corners corners;  ///< Of the start; still right around what is untouched.
    const std::vector<char>& movable;
    const std::vector<char>& fixed;  ///< Per vertex: a move of it was taken back.
    double tolerance;
    double detail;  ///< What is smaller need not be looked at.
    Surface::Probe& probe;
    const std::vector<const CrossingGrid*>& reached;
    std::set<std::pair<int, int>>&
        lost;                     ///< Edges, ascending, that may come back and are not to be made anew.
    std::vector<char>& searched;  ///< Per triangle: in vain, as it is.
    long& short_ones_left;        ///< So many moves are still tried for triangles of less than half a detail.
    std::vector<char> touched;    ///< Per vertex: a change is near.
    std::unique_ptr<TriangleBoxes>& boxes;  ///< Made when they are asked for.

    double sharpness_of(const Triangle& t) const;
    Replaced replaced(std::vector<int> numbers) const;
    /// Whether all these triangles face the way the surface does, or no worse than those they stand for, are
    /// within the tolerance of it, and with those beside them keep what those stand for of what is reached
    /// within the tolerance.
    bool may_have(const std::vector<Triangle>& candidates, const Replaced& before);
    /// The triangles but `except` (ascending) whose boxes meet this one.
    std::vector<Triangle> near(const Box& box, const std::vector<int>& except);

private:
    double facing(const std::vector<Triangle>& some) const;
    bool reach_what(const Replaced& before, const std::vector<Triangle>& candidates);
};

/// The largest cotangent that makes a change of triangles with this one worth it: a tenth less, or as little
/// as is wanted.
inline double worth(double before) {
    constexpr double kGain = 0.9;
    return std::max(kGain * before, kSharpnessAt30Degrees);
}

/// The other diagonal for the longest edge of a triangle with this cotangent.
std::optional<Blunting> flip(BluntedMesh& mesh, int triangle, double sharpness);

/// Another place for one of its corners.
std::optional<Blunting> nudge(BluntedMesh& mesh, int triangle, double sharpness);

}  // namespace isotrack
