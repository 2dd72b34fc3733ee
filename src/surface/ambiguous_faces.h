// Faces of lattice cells whose two inside nodes are across a diagonal: which two nodes hang together.
#pragma once

#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include <algorithm>
#include <array>
#include <cstdint>

#include "isotrack/types.h"

namespace isotrack {

/// Whether volumeToMesh joins the inside nodes of such a face, by its tables: unless both cells that share
/// the face hold no more inside nodes than these two and one next to one of them. `inside(side, u, w)`: of
/// the nodes one step off the face, on either side (0, 1); the inside nodes of the face are at u = w = 0 and
/// u = w = 1.
template <typename Inside>
bool joins_diagonal(const Inside& inside) {
    for (const int side : {0, 1}) {
        const int beside_ends = inside(side, 0, 0) + inside(side, 1, 1),
                  beside_others = inside(side, 0, 1) + inside(side, 1, 0);
        if (beside_ends > 1 || beside_others > 0) return true;
    }
    return false;
}

/// The corners of a cell that are inside: bit 4 i + 2 j + k.
inline unsigned inside_corners(const float (&v)[2][2][2]) {
#ifdef __SSE2__  // the same in a quarter of the instructions: every value asked for needs it
    const auto inside_of = [](const float* four) {
        return static_cast<unsigned>(_mm_movemask_ps(_mm_cmplt_ps(_mm_loadu_ps(four), _mm_setzero_ps())));
    };
    return inside_of(v[0][0]) | inside_of(v[1][0]) << 4;
#else
    unsigned inside = 0;
    for (unsigned c = 0; c < 8; ++c)
        inside |= static_cast<unsigned>(v[c >> 2][c >> 1 & 1][c & 1] < 0.0f) << c;
    return inside;
#endif
}

/// The ambiguous faces of a cell by its corners that are inside: bit 2 axis + side.
inline const std::array<std::uint8_t, 256> kAmbiguousFaces = [] {
    constexpr unsigned kStep[] = {4, 2, 1};
    std::array<std::uint8_t, 256> result{};
    for (unsigned mask = 0; mask < 256; ++mask)
        for (unsigned face = 0; face < 6; ++face) {
            const unsigned axis = face >> 1, b = kStep[(axis + 1) % 3], c = kStep[(axis + 2) % 3];
            const auto inside = [&](unsigned corner) {
                return (mask >> ((face & 1) * kStep[axis] + corner) & 1u) != 0;
            };
            if (inside(0) == inside(b + c) && inside(b) == inside(c) && inside(0) != inside(b))
                result[mask] |= static_cast<std::uint8_t>(1u << face);
        }
    return result;
}();

/// Of the ambiguous face of a cell across `axis`, on `side` (0, 1). `at(i, j, k)`: the value at a node, the
/// corners being 0 or 1; one step further out is asked for, too.
template <typename At>
bool joins_face(const At& at, int axis, int side) {
    const auto inside = [&](int out, int u, int w) {
        int i[3];
        i[axis] = out;
        i[(axis + 1) % 3] = u;
        i[(axis + 2) % 3] = w;
        return static_cast<double>(at(i[0], i[1], i[2])) < 0.0;
    };
    const int turned = !inside(side, 0, 0);                // u counts from the other end
    return joins_diagonal([&](int beyond, int u, int w) {  // which costs more to ask
        return inside(beyond == 0 ? 1 - side : 3 * side - 1, turned ? 1 - u : u, w);
    });
}

/// Those of a cell's ambiguous faces whose inside nodes volumeToMesh joins, as in `kAmbiguousFaces`. `v`: the
/// values at the corners; `beyond` as `at` above, asked one step further out alone.
template <typename At>
unsigned joined_faces(const float (&v)[2][2][2], const At& beyond) {
    const auto at = [&](int i, int j, int k) {
        return ((i | j | k) & ~1) == 0 ? v[i][j][k] : beyond(i, j, k);
    };
    const unsigned faces = kAmbiguousFaces[inside_corners(v)];
    unsigned result = 0;
    for (int face = 0; faces >> face != 0; ++face)
        if ((faces >> face & 1u) != 0 && joins_face(at, face >> 1, face & 1)) result |= 1u << face;
    return result;
}

/// What makes the trilinear value at t in a cell join what volumeToMesh joins. Where they differ a face is
/// interpolated on the two triangles along the diagonal of what is joined instead; into the cell that fades
/// away linearly. 0 on the edges, continuous across faces. `v` and `joined_ones`: see `joined_faces`.
inline double joining_correction(const float (&v)[2][2][2], unsigned joined_ones, const Vec3& t) {
    double sum = 0.0;
    const unsigned faces = kAmbiguousFaces[inside_corners(v)];
    for (int face = 0; faces >> face != 0; ++face) {
        if ((faces >> face & 1u) == 0) continue;
        const int axis = face >> 1, side = face & 1, b = (axis + 1) % 3, c = (axis + 2) % 3;
        const auto value = [&](int u, int w) {
            int i[3];
            i[axis] = side;
            i[b] = u;
            i[c] = w;
            return static_cast<double>(v[i[0]][i[1]][i[2]]);
        };
        const int turned = !(value(0, 0) < 0.0);  // u counts from the other end
        const double in0 = value(turned, 0), in1 = value(1 - turned, 1), out0 = value(1 - turned, 0),
                     out1 = value(turned, 1);
        const bool joined = (joined_ones >> face & 1u) != 0;
        // Whether the trilinear value keeps its sign on the diagonal.
        const double out = out0 + out1, in = in0 + in1;
        if (joined ? out * out < 4.0 * in0 * in1 : in * in < 4.0 * out0 * out1) continue;
        const double u = turned ? 1.0 - t[b] : t[b], w = joined ? t[c] : 1.0 - t[c],
                     nearness = side == 0 ? 1.0 - t[axis] : t[axis], bulge = joined ? out - in : in - out;
        sum -= nearness * bulge * std::min(u, w) * (1.0 - std::max(u, w));
    }
    return sum;
}

}  // namespace isotrack
