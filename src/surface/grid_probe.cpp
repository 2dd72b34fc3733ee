#include "surface/grid_probe.h"

#include <cmath>

namespace isotrack {
namespace {

constexpr double kProjectionError = 1e-4;  // voxels; float values carry no more

}  // namespace

GridProbe::GridProbe(const openvdb::FloatTree& tree, const LeafTable& table, const AffineMap& map,
                     double band)
    : Probe(kProjectionError * map.voxel_size, map.voxel_size),
      map_(map),
      stencil_(tree, &table),
      band_(band) {}

double GridProbe::farther_value(const Vec3& p) {
    const double value = stencil_.value(map_.to_index(p)).farther;
    return std::abs(value) < kInBand * band_ ? value : beyond_band(p, value);
}

void GridProbe::farther_values(const Vec3* points, std::size_t count, double* values) {
    for (std::size_t i = 0; i < count; ++i) stencil_.prefetch(map_.to_index(points[i]));
    for (std::size_t i = 0; i < count; ++i) values[i] = farther_value(points[i]);
}

Surface::Sample GridProbe::sample(const Vec3& p) {
    Surface::Sample s = stencil_.sample(map_.to_index(p));
    s.gradient = map_.gradient_to_world(s.gradient);
    return s;
}

Surface::Probe::CellValues GridProbe::cell_values(const Vec3& low, const Eigen::Affine3d& /*lattice*/) {
    CellValues result;
    float v[2][2][2];
    stencil_.corners(low, v);
    for (int k = 0; k < 8; ++k) result[k] = v[k & 1][k >> 1 & 1][k >> 2];
    return result;
}

/// Beyond the band values are all alike. There the distance is that to a point in the band and its value,
/// no less than the true one; least where that point lies on the shortest way, which its gradient
/// tells. Where the band is not near it is as far as distances are known.
double GridProbe::beyond_band(const Vec3& p, double value) {
    constexpr double kLeastSlope = 0.05;
    const double side = value < 0.0 ? -1.0 : 1.0;
    const double length = kBeyondBand * band_;
    double distance = length + band_;
    const auto value_at = [&](const Vec3& q) { return std::abs(stencil_.value(map_.to_index(q)).farther); };
    const auto try_at = [&](const Vec3& q) {
        const double there = value_at(q);
        if (!(there < kInBand * band_ && length + there < distance)) return false;
        distance = length + there;
        return true;
    };
    const auto aim_from = [&](const Vec3& from) {
        constexpr int kAims = 2;
        Vec3 gradient = sample(from).gradient;
        bool any = false;
        for (int aim = 0; aim < kAims && gradient.norm() > kLeastSlope; ++aim) {
            const Vec3 q = p - side * length * gradient.normalized();
            if (!try_at(q)) break;
            any = true;
            if (aim + 1 < kAims) gradient = sample(q).gradient;
        }
        return any;
    };
    // Next to the band some nodes of it are around; else it is looked for.
    if (!aim_from(p)) {
        Vec3 nearest = p;
        double least = band_;
        for (int axis = 0; axis < 3; ++axis)
            for (const double step : {-length, length}) {
                const Vec3 q = p + step * Vec3::Unit(axis);
                const double there = value_at(q);
                if (!(there < least)) continue;
                least = there;
                nearest = q;
            }
        if (least < kInBand * band_) distance = length + least;
        aim_from(nearest);
    }
    return side * distance;
}

}  // namespace isotrack
