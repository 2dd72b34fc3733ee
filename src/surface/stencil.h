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
    explicit Stencil(const openvdb::FloatTree& tree) : nodes_(tree) {}

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
        const auto mix = [](double a, double b, double s) { return a + s * (b - a); };
        double planes[2];
        for (int i = 0; i < 2; ++i)
            planes[i] = mix(mix(v[i][0][0], v[i][0][1], t.z()), mix(v[i][1][0], v[i][1][1], t.z()), t.y());
        const double trilinear = mix(planes[0], planes[1], t.x());
        if (kAmbiguousFaces[inside_corners(v)] == 0) return {trilinear, trilinear};
        const double joined = trilinear + joining_correction(v, joined_in(base, v), t);
        return {joined, is_farther(trilinear, joined) ? trilinear : joined};
    }

    /// Trilinear value, and the trilinear interpolation of the central differences at the corners, per voxel.
    Surface::Sample sample(const Vec3& index) {
        Vec3 t;
        const openvdb::Coord base = split(index, t);
        float v[4][4][4];  // v[i + 1][j + 1][k + 1] at base + (i, j, k)
        nodes_.block(base.offsetBy(-1), v);
        const double w[3][2] = {{1.0 - t.x(), t.x()}, {1.0 - t.y(), t.y()}, {1.0 - t.z(), t.z()}};
        Surface::Sample result{0.0, Vec3::Zero()};
        for (int a = 0; a < 2; ++a)
            for (int b = 0; b < 2; ++b) {
                const double xy = w[0][a] * w[1][b], yz = w[1][a] * w[2][b], xz = w[0][a] * w[2][b];
                const float* line = v[a + 1][b + 1];
                result.value += xy * (w[2][0] * line[1] + w[2][1] * line[2]);
                result.gradient.z() += xy * (w[2][0] * (line[2] - line[0]) + w[2][1] * (line[3] - line[1]));
                result.gradient.x() += yz * (w[0][0] * (v[2][a + 1][b + 1] - v[0][a + 1][b + 1]) +
                                             w[0][1] * (v[3][a + 1][b + 1] - v[1][a + 1][b + 1]));
                result.gradient.y() += xz * (w[1][0] * (v[a + 1][2][b + 1] - v[a + 1][0][b + 1]) +
                                             w[1][1] * (v[a + 1][3][b + 1] - v[a + 1][1][b + 1]));
            }
        result.gradient *= 0.5;
        const float corners[2][2][2] = {{{v[1][1][1], v[1][1][2]}, {v[1][2][1], v[1][2][2]}},
                                        {{v[2][1][1], v[2][1][2]}, {v[2][2][1], v[2][2][2]}}};
        if (kAmbiguousFaces[inside_corners(corners)] != 0)
            result.value += joining_correction(corners, joined_in(base, corners), t);
        return result;
    }

private:
    // Of the trilinear value: with less the joined surface is near, which must do.
    static constexpr double kNoLess = 0.5;

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
