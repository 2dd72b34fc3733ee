// The centroid of a cell of the DT.
#pragma once

#include "isotrack/delaunay/tetrahedralisation.h"
#include "isotrack/sampling/particles.h"

namespace isotrack {

/// Of a finite cell, whose vertices are particles.
inline Vec3 centroid_of(int cell, const Tetrahedra& cells, const Particles& particles) {
    Vec3 result = Vec3::Zero();
    for (const int v : cells.vertices[cell]) result += 0.25 * particles.position[v];
    return result;
}

}  // namespace isotrack
