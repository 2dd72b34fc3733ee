// A surface given by an OpenVDB grid, as such grids really come.
#pragma once

#include <openvdb/openvdb.h>

#include <memory>
#include <string>

#include "isotrack/surface/surface.h"

namespace isotrack {

struct LevelSetOptions {
    /// The surface is where the grid has this value, in the grid's own unit. On a grid of class fog volume
    /// the inside is where the density is higher, on every other grid where the value is lower.
    double iso = 0.0;
};

/// The level set of a FloatGrid or DoubleGrid.
///
/// Values are trilinear, but for faces of lattice cells whose two inside nodes are across a diagonal: those
/// are joined where volumeToMesh joins them, so that the surface has its topology. Gradients are the
/// trilinear interpolation of central differences at the nodes: continuous, second order. Any linear
/// transform is understood; gradients and distances are of the world. Values that are distances in voxels
/// (measured at the surface) are turned into world units. Inside and outside are known everywhere: inactive
/// voxels and tiles carry a sign, a background of zero means outside, NaN and infinity mean outside, minus
/// infinity inside, and a surface that runs into the border of its voxels is closed there by a flat cap one
/// voxel beyond the last of them, where volumeToMesh would put it. Immutable after construction; const
/// members may be called from any number of threads. A `lattice_mesh` around places all over the grid, and a
/// `light_lattice_mesh`, keep some 40 bytes for each crossed edge as long as this lives, for the next one.
class LevelSet : public Surface {
public:
    /// \throws InputError if the grid is neither float nor double, if its transform is not linear, or if it
    /// cannot be a level set: a grid with active voxels, of a class other than level set, whose values do not
    /// take both signs around `iso`, or a level set whose band ends before or about where it would have that
    /// value. A level set without voxels, or without a surface, is allowed: `bounds()` is empty.
    explicit LevelSet(openvdb::GridBase::ConstPtr grid, const LevelSetOptions& options = {});
    ~LevelSet() override;

    std::unique_ptr<Probe> probe() const override;
    double resolution() const override;
    double reach() const override;
    double slope() const override;
    Box bounds() const override;
    Eigen::Affine3d lattice() const override;
    /// Whether the lattice cell around p has an inactive voxel of the grid as it came for a corner. A band is
    /// at least a voxel wide on both sides of the surface, so there the surface leaves the active voxels: it
    /// meets the border.
    bool at_border(const Vec3& p) const override;
    using Surface::crossings;
    CrossingSequence crossing_sequence(double apart) const override;
    std::vector<Crossing> crossings_near(const std::vector<Vec3>& places, double reach) const override;
    std::vector<Eigen::Vector3i> upright_crossings() const override;
    std::vector<Diagonal> diagonals() const override;
    std::optional<long> lattice_euler() const override;  ///< Those of volumeToMesh, this and the next two.
    std::optional<std::size_t> lattice_component_count() const override;
    std::optional<std::vector<Box>> lattice_components() const override;
    TriangleMesh lattice_mesh(const std::vector<Vec3>& places, double reach) const override;
    TriangleMesh light_lattice_mesh(double close) const override;

    /// True when there is no surface: no sign change between neighbouring voxels.
    bool empty() const;
    /// Length of a voxel edge in world units; the cube root of the voxel's volume where the edges differ.
    double voxel_size() const { return resolution(); }
    std::size_t active_voxels() const;
    /// World units per grid unit: 1 for distances in world units, the voxel size for distances in voxels.
    double value_scale() const;
    /// Edges between neighbouring voxels that cross the surface.
    std::size_t crossing_count() const;
    /// Those of them that leave the active voxels: where this is not zero the surface meets the border of its
    /// grid.
    std::size_t border_crossings() const;
    /// The grid that is sampled: values in world units, negative inside, the surface at zero.
    openvdb::FloatGrid::ConstPtr grid() const;

private:
    struct Impl;
    std::unique_ptr<const Impl> impl_;
};

}  // namespace isotrack
