// One frame's mesh held against its surface, and what would mend it.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "isotrack/meshing/certify.h"
#include "isotrack/meshing/lattice_topology.h"
#include "isotrack/meshing/manifold.h"
#include "isotrack/sampling/particles.h"
#include "isotrack/sampling/population.h"
#include "isotrack/sampling/sizing.h"
#include "isotrack/tracking/tracker.h"
#include "tracking/facets.h"
#include "tracking/triangle_index.h"

namespace isotrack {

struct FrameMesh {
    CarvedSurface carved;
    std::vector<Vec3> vertices;    ///< Of the mesh: fitted when asked for.
    std::vector<Vec3> on_surface;  ///< The same vertices before the fit.
};

struct Inspection {
    std::shared_ptr<const std::vector<TriangleError>> errors;  ///< Per triangle; the inspector has them, too.
    std::vector<Surface::Crossing> missed;  ///< Crossings farther from the mesh than the tolerance.
    double farthest_crossing = 0.0, crossings_mean_square = 0.0;  ///< Of those that were found.
    std::size_t lost_crossings = 0;                               ///< Those that were not.
    LatticeTopology topology;
    std::vector<Shortage> doubtful;  ///< Crossings near its faults and near what was mended in vain.
};

/// The largest of `errors` (one per triangle) around each of so many particles; negative without a triangle.
std::vector<double> errors_at_particles(const FrameMesh& mesh, const std::vector<TriangleError>& errors,
                                        std::size_t particles);

/// Inspects the meshes of one frame, each a little different from the one before: what lies away from the
/// triangles that changed is not measured again.
class Inspector {
public:
    /// All three must outlive it.
    Inspector(const Surface& surface, const SizingLimits& limits, const CrossingGrid& crossings)
        : surface_(surface), limits_(limits), crossings_(crossings) {}

    /// From now on come meshes of other particles: those before are forgotten.
    void restart();
    /// Before the first mesh is there: measures triangles that it is likely to have. Where it does, with
    /// vertices on these very places, nothing is measured again.
    void expect(const std::vector<Vec3>& particles, const std::vector<Triangle>& triangles);

    /// From mesh to surface alone.
    Inspection inspect(const FrameMesh& mesh);
    /// From mesh to surface and back.
    Inspection inspect_both_ways(const FrameMesh& mesh);
    /// What looking at the topology needs of the surface alone; done then if not before.
    void prepare_topology();
    /// The topology of the mesh just inspected.
    void inspect_topology(const FrameMesh& mesh, Inspection& inspection);

private:
    /// Measures the triangles that are not those of the mesh before. Both return what cannot be mended, or
    /// was not when it was seen last.
    std::vector<Vec3> measure_errors(const FrameMesh& mesh, Inspection& result);
    std::vector<Vec3> measure_distances(const FrameMesh& mesh, Inspection& result);
    bool is_missed(double distance) const;
    /// Adds the lattice crossings near some places to the doubtful ones; `spacing` in resolutions.
    void doubt(const std::vector<Vec3>& places, double spacing, Inspection& inspection) const;

    const Surface& surface_;
    const SizingLimits& limits_;
    const CrossingGrid& crossings_;
    struct Expected {
        TriangleIndex triangles;  // of particles
        std::vector<TriangleError> errors;
    };
    std::optional<Expected> expected_;  // before the first inspection
    double reach_ = 0.0;                // the largest of the distances, at most the cutoff
    std::vector<Facet> facets_;         // of the last inspection
    std::shared_ptr<const std::vector<TriangleError>> errors_;  // of each
    std::vector<Facet> came_, went_;                            // since the inspection before
    std::vector<double> distances_;  // to the facets, per crossing; empty: not measured yet
    std::vector<int> missed_;        // of the crossings
    std::optional<LatticeSides> sides_;
    int looks_ = 0;  // at the topology
};

/// Where particles are missing: at the dual crossings of triangles with too large an error or, where the
/// surface is smooth, too small an angle; in the middle of the longest edge of what is sharper than 18
/// degrees across a crease, if a resolution high or more; at crossings that are missed; around nodes whose
/// side is wrong; on complex edges.
std::vector<Shortage> shortages(const FrameMesh& mesh, const Inspection& inspection, const Tetrahedra& cells,
                                const Particles& particles, const Surface& surface,
                                const SizingLimits& limits);

/// The errors into the frame's row.
void report(const FrameMesh& mesh, const Inspection& inspection, const SizingLimits& limits,
            TrackedFrame& frame);

/// Takes components without a lattice node off the mesh just inspected, but for those that stand for
/// crossings which nothing else stands for.
void remove_specks(FrameMesh& mesh, Inspection& inspection, Inspector& inspector, const SizingLimits& limits);

}  // namespace isotrack
