// One frame's mesh held against its surface, and what would mend it.
#pragma once

#include <array>
#include <vector>

#include "isotrack/meshing/certify.h"
#include "isotrack/meshing/lattice_topology.h"
#include "isotrack/meshing/manifold.h"
#include "isotrack/sampling/particles.h"
#include "isotrack/sampling/population.h"
#include "isotrack/sampling/sizing.h"
#include "isotrack/tracking/tracker.h"

namespace isotrack {

struct FrameMesh {
    CarvedSurface carved;
    std::vector<Vec3> vertices;    ///< Of the mesh: fitted when asked for.
    std::vector<Vec3> on_surface;  ///< The same vertices before the fit.
};

struct Inspection {
    std::vector<TriangleError> errors;  ///< Per triangle.
    struct Facet {
        int key;  ///< Of the cell and its facet; ascending but for halves of split triangles, which have -1.
        std::array<Vec3, 3> corner;
    };
    std::vector<Facet> facets;              ///< Per triangle, as the errors were measured.
    std::vector<Surface::Crossing> missed;  ///< Crossings farther from the mesh than the tolerance.
    double farthest_crossing = 0.0, crossings_mean_square = 0.0;  ///< Of those that were found.
    std::size_t lost_crossings = 0;                               ///< Those that were not.
    LatticeTopology topology;
    std::vector<Vec3> doubtful;  ///< Crossings near its faults.
};

/// Both ways, and the topology. Errors of triangles that `before` has, too, are taken over.
Inspection inspect(const FrameMesh& mesh, const Surface& surface, const SizingLimits& limits,
                   const CrossingGrid& crossings, const Inspection& before);

/// Mesh to surface, and only those crossings that `before` missed.
Inspection inspect_again(const FrameMesh& mesh, const Surface& surface, const SizingLimits& limits,
                         const Inspection& before);

/// Where particles are missing: at the dual crossings of triangles with too large an error or, where the
/// surface is smooth, too small an angle; at crossings that are missed; around nodes whose side is wrong; on
/// complex edges.
std::vector<Shortage> shortages(const FrameMesh& mesh, const Inspection& inspection, const Tetrahedra& cells,
                                const Particles& particles, const Surface& surface,
                                const SizingLimits& limits);

/// The errors into the frame's row.
void report(const FrameMesh& mesh, const Inspection& inspection, const SizingLimits& limits,
            TrackedFrame& frame);

/// Takes components without a lattice node off the mesh.
void remove_specks(FrameMesh& mesh, const Inspection& inspection);

}  // namespace isotrack
