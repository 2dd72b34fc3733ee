// A list of crossings in less memory.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "isotrack/surface/surface.h"

namespace isotrack {

/// In 16 bytes each, less than half: their directions are those of the edges of a lattice, middles of some of
/// these, or none, and points are floats from a place on.
class PackedCrossings {
public:
    /// Some directions: bit k for up along axis k, bit 3 + k for down.
    using Ways = std::uint32_t;
    static constexpr Ways kNoWay = 0;
    struct Entry {
        Eigen::Vector3f offset;  // from the origin
        Ways ways;
    };
    std::vector<Entry> entries;

    /// `origin`: points are exact to 1e-7 of how far they are from it.
    PackedCrossings(const Vec3& origin, const Eigen::Affine3d& lattice) : origin_(origin) {
        for (int axis = 0; axis < 3; ++axis) {
            along_[axis] = lattice.linear().col(axis).normalized().cast<float>();
            along_[axis + 3] = -along_[axis];
        }
        for (Ways ways = 0; ways < outward_.size(); ++ways) outward_[ways] = middle_of(ways);
    }

    std::size_t size() const { return entries.size(); }
    Vec3 point(std::size_t i) const { return origin_ + entries[i].offset.cast<double>(); }
    Surface::Crossing operator[](std::size_t i) const { return {point(i), outward_[entries[i].ways]}; }

    /// One that goes the middle between some ways; any of them where they cancel out. With no way its
    /// direction is zero.
    Entry packed(const Vec3& point, Ways ways) const { return {(point - origin_).cast<float>(), ways}; }

private:
    Eigen::Vector3f middle_of(Ways ways) const {
        constexpr float kLeast = 0.01f;  // length of a sum that does not cancel out
        Eigen::Vector3f sum = Eigen::Vector3f::Zero(), any = sum;
        for (std::size_t w = 0; w < along_.size(); ++w) {
            if ((ways >> w & 1u) == 0) continue;
            any = along_[w];
            sum += any;
        }
        return sum.squaredNorm() > kLeast * kLeast ? Eigen::Vector3f(sum.normalized()) : any;
    }

    Vec3 origin_;
    std::array<Eigen::Vector3f, 6> along_;     // unit, by way
    std::array<Eigen::Vector3f, 64> outward_;  // by ways
};

}  // namespace isotrack
