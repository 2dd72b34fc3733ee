// Interpolation in a grid.
#pragma once

#include <openvdb/openvdb.h>

#include <cmath>

#include "isotrack/surface/surface.h"
#include "surface/ambiguous_faces.h"
#include "surface/node_values.h"

namespace isotrack {

/// Values around one lattice cell. The cell's corners are (0..1)^3; the values one further out in each axis
/// are those that the central differences at the corners need.
class Stencil {
public:
    explicit Stencil(const openvdb::FloatTree& tree, const LeafTable* table = nullptr)
        : nodes_(tree, table) {}

    /// Of an ambiguous cell also without what joins its nodes, where that is farther on the same side, by up
    /// to twice.
    struct Value {
        double joined, farther;
    };
    Value value(const Vec3& index) {
        Vec3 t;
        const openvdb::Coord base = split(index, t);
        float v[2][2][2];
        nodes_.block(base, v);
        const double trilinear = Stencil::trilinear(v, t);
        if (kAmbiguousFaces[inside_corners(v)] == 0) return {trilinear, trilinear};
        const double joined = trilinear + joining_correction(v, joined_in(base, v), t);
        return {joined, is_farther(trilinear, joined) ? trilinear : joined};
    }

    /// Brings most of what `value` reads there towards the caches.
    void prefetch(const Vec3& index) {
        Vec3 t;
        nodes_.prefetch(split(index, t));
    }

    /// The values at a cell's corners.
    void corners(const Vec3& low, float (&v)[2][2][2]) {
        Vec3 t;
        nodes_.block(split(low, t), v);
    }

    /// Trilinear value, and the trilinear interpolation of the central differences at the corners, per voxel.
    Surface::Sample sample(const Vec3& index) {
        Vec3 t;
        const openvdb::Coord base = split(index, t);
        float v[4][4][4];  // v[i + 1][j + 1][k + 1] at base + (i, j, k)
        nodes_.block(base.offsetBy(-1), v);
        using Column = Eigen::Array4d;  // along the third axis
        const auto column = [&](int i, int j) {
            return Eigen::Map<const Eigen::Array4f>(v[i][j]).cast<double>();
        };
        const double w[3][2] = {{1.0 - t.x(), t.x()}, {1.0 - t.y(), t.y()}, {1.0 - t.z(), t.z()}};
        Column across[4], along[4];  // interpolated along the second axis, along the first
        for (int i = 0; i < 4; ++i) {
            across[i] = w[1][0] * column(i, 1) + w[1][1] * column(i, 2);
            along[i] = w[0][0] * column(1, i) + w[0][1] * column(2, i);
        }
        const Column x = w[0][0] * (across[2] - across[0]) + w[0][1] * (across[3] - across[1]),
                     y = w[1][0] * (along[2] - along[0]) + w[1][1] * (along[3] - along[1]),
                     middle = w[0][0] * across[1] + w[0][1] * across[2];
        Surface::Sample result{
            0.0, 0.5 * Vec3(w[2][0] * x[1] + w[2][1] * x[2], w[2][0] * y[1] + w[2][1] * y[2],
                            w[2][0] * (middle[2] - middle[0]) + w[2][1] * (middle[3] - middle[1]))};
        const float corners[2][2][2] = {{{v[1][1][1], v[1][1][2]}, {v[1][2][1], v[1][2][2]}},
                                        {{v[2][1][1], v[2][1][2]}, {v[2][2][1], v[2][2][2]}}};
        result.value = trilinear(corners, t);
        if (kAmbiguousFaces[inside_corners(corners)] != 0)
            result.value += joining_correction(corners, joined_in(base, corners), t);
        return result;
    }

private:
    // Of the trilinear value: with less the joined surface is near, which must do.
    static constexpr double kNoLess = 0.5;

    static double trilinear(const float (&v)[2][2][2], const Vec3& t) {
        const auto mix = [](double a, double b, double s) { return a + s * (b - a); };
        double planes[2];
        for (int i = 0; i < 2; ++i)
            planes[i] = mix(mix(v[i][0][0], v[i][0][1], t.z()), mix(v[i][1][0], v[i][1][1], t.z()), t.y());
        return mix(planes[0], planes[1], t.x());
    }
    static bool is_farther(double trilinear, double joined) {
        return (joined < 0.0) == (trilinear < 0.0) && std::abs(trilinear) > std::abs(joined) &&
               std::abs(joined) > kNoLess * std::abs(trilinear);
    }
    /// `joined_faces` of an ambiguous cell: those met lately are kept, by where they are among their
    /// neighbours.
    unsigned joined_in(const openvdb::Coord& cell, const float (&v)[2][2][2]) {
        JoinedFaces& kept = joined_[((cell.x() & 3) << 4) | ((cell.y() & 3) << 2) | (cell.z() & 3)];
        if (!kept.known || kept.cell != cell)
            kept = {cell, true,
                    joined_faces(v, [&](int i, int j, int k) { return nodes_.at(cell.offsetBy(i, j, k)); })};
        return kept.faces;
    }
    static openvdb::Coord split(const Vec3& index, Vec3& t) {
        // Points far outside any grid, or not finite, read the background at a corner of the representable
        // range.
        constexpr double kLimit = 1 << 30;
        openvdb::Coord base;
        for (int axis = 0; axis < 3; ++axis) {
            double x = index[axis];
            if (!(std::abs(x) < kLimit)) x = x < 0.0 && std::isfinite(x) ? -kLimit : kLimit;
            const int towards_zero = static_cast<int>(x);
            base[axis] = towards_zero - (x < towards_zero);
            t[axis] = x - base[axis];
        }
        return base;
    }

    struct JoinedFaces {
        openvdb::Coord cell;
        bool known = false;
        unsigned faces = 0;
    };
    NodeValues nodes_;
    JoinedFaces joined_[64];
};

}  // namespace isotrack
