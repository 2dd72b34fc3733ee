// The two ways to make a sharp triangle blunter.
#pragma once

#include <optional>
#include <vector>

#include "isotrack/meshing/blunting.h"
#include "meshing/corners.h"

namespace isotrack {

/// A mesh in the course of a pass.
struct BluntedMesh {
    std::vector<Vec3>& points;
    std::vector<Triangle>& triangles;
    const Corners corners;  ///< Of the start; still right around what is untouched.
    const std::vector<char>& movable;
    double tolerance;
    Surface::Probe& probe;
    std::vector<char> touched;  ///< Per vertex: a change is near.

    double sharpness_of(const Triangle& t) const;
    /// The least cosine between their normals and the surface's.
    double facing(const std::vector<Triangle>& some) const;
    /// Whether all these triangles face the way the surface does, or no worse than those they stand for, and
    /// are within the tolerance of it.
    bool may_have(const std::vector<Triangle>& candidates, double facing_before) const;
};

constexpr double kBluntGain = 0.9;  // of the cotangent, at most, for a change to be worth it

/// The other diagonal for the longest edge of a triangle with this cotangent.
std::optional<Blunting> flip(BluntedMesh& mesh, int triangle, double sharpness);

/// Another place for one of its corners.
std::optional<Blunting> nudge(BluntedMesh& mesh, int triangle);

}  // namespace isotrack
