// Particles: samples that live on the surface over many frames.
#pragma once

#include <vector>

#include "isotrack/types.h"

namespace isotrack {

/// Structure of arrays, all of the same length; entry i is one particle. World units.
struct Particles {
    std::vector<Vec3> position;  ///< On the surface.
    std::vector<Vec3> normal;    ///< Unit, outward (O2).
    std::vector<double>
        spacing;  ///< Wanted distance h to the nearest neighbour; 1/h is the paper's k in world units.
    std::vector<Vec3> stretch;   ///< Where the surface bends less one way than the other, along that way; s =
                                 ///< 1 + |stretch|^2 is how many times longer triangles should be along it
                                 ///< than across. Zero: all ways alike.
    std::vector<Id> id;          ///< Unique over the run, never reused.
    std::vector<Vec3> velocity;  ///< Displacement since the last frame; that of their neighbours for the
                                 ///< newborn, zero without any.

    std::size_t size() const { return position.size(); }
    bool empty() const { return position.empty(); }
    void add(const Vec3& p, const Vec3& n, double h, Id new_id, const Vec3& v = Vec3::Zero());
    /// Keeps, in order, the particles whose flag is set. `keep` has one entry per particle.
    void retain(const std::vector<char>& keep);
    /// Particle i becomes that of order[i], which has every index once.
    void reorder(const std::vector<int>& order);
    void clear();
};

}  // namespace isotrack
