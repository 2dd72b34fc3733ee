// The fit of one frame's meshes, each a little different from the one before.
#pragma once

#include <cstddef>
#include <vector>

#include "isotrack/surface/surface.h"
#include "tracking/facets.h"
#include "tracking/inspection.h"

namespace isotrack {

/// Where the vertices of the last mesh were fitted to.
class Fitted {
public:
    /// Fits anew what is within two rings of where the mesh differs from the last one; the rest goes to where
    /// it was. `particles`: how many there are.
    void fit_vertices(FrameMesh& mesh, std::size_t particles, const Surface& surface);

    /// Puts fitted vertices back where their triangles cross others, a ring further each time, until none
    /// cross. Facets of a DT do not. Returns whether any did.
    bool undo_crossing(FrameMesh& mesh, std::size_t particles);

private:
    void take(const FrameMesh& mesh, std::size_t particles);

    std::vector<Facet> facets_;   // before the fit
    std::vector<Vec3> position_;  // per particle
};

}  // namespace isotrack
