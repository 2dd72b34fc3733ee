// Places on a surface, found by where they are and which way the surface faces there.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "isotrack/surface/crossing_grid.h"
#include "isotrack/surface/surface.h"

namespace isotrack {

/// Some of a surface's crossings with the normals there. Read-only, so threads may share it.
class OrientedPlaces {
public:
    struct Place {
        Vec3 point, normal;
    };

    /// `turn_length`: what a right angle between normals counts as, world units.
    OrientedPlaces(const Surface& surface, const CrossingGrid& crossings, double turn_length);
    ~OrientedPlaces();

    bool empty() const { return places_.empty(); }
    /// The one next to a place and a normal.
    const Place& nearest(const Vec3& point, const Vec3& normal) const;

private:
    struct Tree;
    std::vector<Place> places_;
    double turned_;
    std::unique_ptr<Tree> tree_;
};

}  // namespace isotrack
