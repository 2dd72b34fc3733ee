// One thread's access to the surface in a grid.
#pragma once

#include <openvdb/openvdb.h>

#include "isotrack/surface/surface.h"
#include "surface/affine_map.h"
#include "surface/stencil.h"

namespace isotrack {

class GridProbe final : public Surface::Probe {
public:
    /// `table`: of the tree. `band`: the half width of the grid's band, world units. All else must outlive
    /// the probe.
    GridProbe(const openvdb::FloatTree& tree, const LeafTable& table, const AffineMap& map, double band);

    double value(const Vec3& p) override { return stencil_.value(map_.to_index(p)).joined; }
    double farther_value(const Vec3& p) override;
    void farther_values(const Vec3* points, std::size_t count, double* values) override;
    Surface::Sample sample(const Vec3& p) override;
    CellValues cell_values(const Vec3& low, const Eigen::Affine3d& lattice) override;

    /// How far from the surface `farther_value` is right in size.
    static double reach(double band) { return (kInBand + kBeyondBand) * band; }

private:
    static constexpr double kInBand = 0.8;  // of its half width: interpolated values are right up to there
    static constexpr double kBeyondBand = 0.8;  // of it: distances are known as far beyond

    double beyond_band(const Vec3& p, double value);

    const AffineMap& map_;
    Stencil stencil_;
    const double band_;
};

}  // namespace isotrack
