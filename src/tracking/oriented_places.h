// Places on a surface, found by where they are and which way the surface faces there.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "isotrack/surface/crossing_grid.h"
#include "isotrack/surface/surface.h"

namespace isotrack {

/// Some of a surface's crossings, spread over all of them, 4000 at most, with the normals there; those
/// without a normal are left out. Made with TBB. Read-only, so threads may share it; the same at any thread
/// count.
class OrientedPlaces {
public:
    struct Place {
        Vec3 point, normal;
    };

    /// `turn_length`: what a right angle between normals counts as, world units.
    OrientedPlaces(const Surface& surface, const CrossingGrid& crossings, double turn_length);
    ~OrientedPlaces();

    bool empty() const;
    std::size_t size() const;
    /// The one with the least |p - point|^2 + turn_length^2 (1 - cos), the cosine that of the angle between
    /// the normals. Not to be asked when there are none.
    const Place& nearest(const Vec3& point, const Vec3& normal) const;

private:
    struct Tree;
    std::vector<Place> places_;
    double normal_scale_;
    std::unique_ptr<Tree> tree_;
};

}  // namespace isotrack
