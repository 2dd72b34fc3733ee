#include "tracking/advection.h"

#include <openvdb/tree/ValueAccessor.h>

#include <optional>
#include <utility>

namespace isotrack {
namespace {

constexpr double kSameFlow = 0.5;  // of the velocity at the start
constexpr int kTrapezoids = 2;
constexpr double kMostVoxels = 1e9;  // from the origin: farther off there is nothing, nor an integer for it

class VelocityField {
public:
    explicit VelocityField(openvdb::Vec3SGrid::ConstPtr grid)
        : grid_(std::move(grid)), is_staggered_(grid_->getGridClass() == openvdb::GRID_STAGGERED) {}

    Vec3 at_start(const Vec3& p) const {
        const std::optional<openvdb::Vec3d> index = to_index(p);
        if (!index) return Vec3::Zero();
        const std::optional<Vec3> known = known_at(*index);
        const Vec3 v = known ? *known : nearest(*index);
        return v.allFinite() ? v : Vec3(Vec3::Zero());
    }
    std::optional<Vec3> on_the_way(const Vec3& p, const Vec3& start) const {
        const std::optional<openvdb::Vec3d> index = to_index(p);
        const std::optional<Vec3> v = index ? known_at(*index) : std::nullopt;
        return v && (*v - start).norm() < kSameFlow * start.norm() ? v : std::nullopt;
    }

private:
    // Not registered with the tree, which would lock: one is made for each look.
    using Accessor = openvdb::tree::ValueAccessor<const openvdb::Vec3STree, false>;

    /// None where it is too far off, or not finite.
    std::optional<openvdb::Vec3d> to_index(const Vec3& p) const {
        const openvdb::Vec3d index = grid_->worldToIndex(openvdb::Vec3d(p.data()));
        if (!(Vec3(index.asPointer()).array().abs() < kMostVoxels).all()) return std::nullopt;
        return index;
    }
    /// Between the active ones of the eight voxels around, of each component.
    std::optional<Vec3> known_at(const openvdb::Vec3d& index) const {
        const Accessor accessor(grid_->tree());
        Vec3 result;
        for (int axis = 0; axis < 3; ++axis) {
            openvdb::Vec3d x = index;
            if (is_staggered_) x[axis] += 0.5;  // it is on the lower faces of the voxels
            const openvdb::Coord low = openvdb::Coord::floor(x);
            const openvdb::Vec3d beyond = x - low.asVec3d();
            double sum = 0.0, weights = 0.0;
            for (int n = 0; n < 8; ++n) {
                double weight = 1.0;
                for (int a = 0; a < 3; ++a) weight *= (n >> a & 1) != 0 ? beyond[a] : 1.0 - beyond[a];
                openvdb::Vec3s v;
                if (weight == 0.0 || !accessor.probeValue(low.offsetBy(n & 1, n >> 1 & 1, n >> 2), v))
                    continue;
                sum += weight * static_cast<double>(v[axis]);
                weights += weight;
            }
            if (!(weights > 0.0)) return std::nullopt;
            result[axis] = sum / weights;
        }
        return result;
    }
    Vec3 nearest(const openvdb::Vec3d& index) const {
        const openvdb::Vec3s v = grid_->tree().getValue(openvdb::Coord::round(index));
        return {v.x(), v.y(), v.z()};
    }

    openvdb::Vec3SGrid::ConstPtr grid_;
    bool is_staggered_;
};

}  // namespace

Tracker::Motion motion_along(const openvdb::Vec3SGrid::ConstPtr& from, const openvdb::Vec3SGrid::ConstPtr& to,
                             double time) {
    std::optional<VelocityField> after;
    if (to) after.emplace(to);
    return [before = VelocityField(from), after, time](const Vec3& p) {
        const Vec3 v = before.at_start(p);
        Vec3 end = p + time * before.on_the_way(p + 0.5 * time * v, v).value_or(v);
        for (int step = 0; after && step < kTrapezoids; ++step)
            if (const auto w = after->on_the_way(end, v)) end = p + 0.5 * time * (v + *w);
        return end;
    };
}

}  // namespace isotrack
