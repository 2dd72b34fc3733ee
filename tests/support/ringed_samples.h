// Samples of a surface, and who of them is next to whom along it.
#pragma once

#include "isotrack/meshing/convection.h"
#include "isotrack/surface/shapes.h"
#include "support/samples.h"
#include "tracking/last_mesh.h"

namespace isotrack::support {

struct RingedSamples : Samples {
    Adjacency ring;

    RingedSamples(const shapes::SurfacePtr& surface, double edge) : Samples(*surface, edge) {
        const CellLabels labels = guided_convection(cells, particles.position, particles.normal, *surface);
        ring = ring_of(particle_triangles(carve(cells, labels, particles.position)), particles.size());
    }
};

}  // namespace isotrack::support
