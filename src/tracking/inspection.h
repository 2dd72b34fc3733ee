// One frame's mesh held against its surface, and what would mend it.
#pragma once

#include <algorithm>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "isotrack/meshing/certify.h"
#include "isotrack/meshing/lattice_topology.h"
#include "isotrack/sampling/particles.h"
#include "isotrack/sampling/population.h"
#include "isotrack/sampling/sizing.h"
#include "isotrack/tracking/tracker.h"
#include "tracking/between_crossings.h"
#include "tracking/facet_error.h"
#include "tracking/facets.h"
#include "tracking/frame_mesh.h"
#include "tracking/mesh_distances.h"
#include "tracking/triangle_index.h"

namespace isotrack {

/// Where particles may be missing.
struct Doubt {
    std::vector<Vec3> places;  ///< At the lattice crossings around them;
    double spacing = 0.0;      ///< as far from others, world units.
    std::vector<Shortage> at;  ///< And there.
};

struct Inspection {
    std::shared_ptr<const std::vector<FacetError>> errors;  ///< Per triangle; the inspector has them, too.
    /// Farther from the mesh than the tolerance: crossings, and points of the surface between such as are
    /// nearly so far off, near folds of the mesh, or in cells with an ambiguous face; see BetweenCrossings.
    std::vector<Surface::Crossing> missed;
    double farthest_crossing = 0.0;      ///< Of these and those, as far as they were found.
    double crossings_mean_square = 0.0;  ///< Of the crossings that were found.
    std::size_t lost_crossings = 0;      ///< Of these and those: not found.
    LatticeTopology topology;
    std::vector<Doubt>
        doubts;  ///< Near its faults at first, near what was mended in vain, and all missed between.
};

/// The largest of `errors` (one per triangle) around each of so many particles; negative without a triangle.
template <typename Error>
std::vector<double> errors_at_particles(const FrameMesh& mesh, const std::vector<Error>& errors,
                                        std::size_t particles) {
    std::vector<double> result(particles, -1.0);
    for (std::size_t t = 0; t < errors.size(); ++t)
        for (const int v : mesh.carved.triangles[t])
            if (const int p = mesh.carved.particle[v]; p >= 0)
                result[p] = std::max<double>(result[p], errors[t].largest);
    return result;
}

/// Inspects the meshes of one frame, each a little different from the one before: what lies away from the
/// triangles that changed is not measured again.
class Inspector {
public:
    /// All three must outlive it.
    Inspector(const Surface& surface, const SizingLimits& limits, const CrossingGrid& crossings);
    Inspector(Inspector&&) = default;  // and no copies: it points into itself

    /// From now on come meshes of other particles: those before are forgotten.
    void restart();
    /// Before the first mesh is there: triangles that it is likely to have, which must stay until what is
    /// returned was called. That measures them, on any thread; most of the memory is taken here, because
    /// what a thread gives back is kept for it alone. Where the mesh has them, with vertices on these very
    /// places, nothing is measured again.
    std::function<void()> expect(const std::vector<Vec3>& particles, const std::vector<Triangle>& triangles);

    /// From mesh to surface alone.
    Inspection inspect(const FrameMesh& mesh);
    /// From mesh to surface and back: from crossings and from the points between them found so far.
    Inspection inspect_both_ways(const FrameMesh& mesh);
    /// Of the mesh just inspected both ways: finds points between crossings that it may miss, and measures
    /// them.
    void look_between(const FrameMesh& mesh, Inspection& inspection);
    /// Of the mesh just inspected both ways: measures from now on also such points between crossings found so
    /// far as no vertex on the surface reaches.
    void look_off_surface(const FrameMesh& mesh, Inspection& inspection);
    /// What `now` misses and another mesh, of these vertices and triangles, does not. That nobody looked
    /// there when it was inspected is no matter.
    std::vector<Surface::Crossing> newly_missed(const Inspection& now, const std::vector<Vec3>& vertices,
                                                const std::vector<Triangle>& triangles) const;
    /// As `inspect` finds them, of triangles of three corners each, from the corner with the least number on:
    /// their last digits depend on the order.
    std::vector<FacetError> errors_of(const std::vector<Vec3>& corners) const;
    /// The crossings, and the points between them found so far.
    std::vector<const CrossingGrid*> reached() const;
    /// Whether some crossings stand for all: the tolerance is several resolutions.
    bool thins_out() const { return crossings_.thinned_out(surface_); }
    /// What looking at the topology needs of the surface alone; done then if not before.
    void prepare_topology();
    /// The surface's, counted once.
    std::optional<std::size_t> lattice_component_count();
    const std::optional<std::vector<Box>>& lattice_components();
    /// The topology of the mesh just inspected. The first time its faults are doubtful places; what more
    /// particles there do not mend then they seldom do.
    void inspect_topology(const FrameMesh& mesh, Inspection& inspection);

private:
    std::vector<FacetError> errors_of(const std::vector<Vec3>& vertices,
                                      const std::vector<Triangle>& triangles) const;
    /// Into memory of the caller, as many as there are triangles.
    void measure_into(std::vector<FacetError>& errors, const std::vector<Vec3>& vertices,
                      const std::vector<Triangle>& triangles) const;
    /// Measures the triangles that are not those of the mesh before. Returns what cannot be mended, or was
    /// not when it was seen last. `changes`: from the mesh before, where distances are kept up to date.
    std::vector<Vec3> measure_errors(const FrameMesh& mesh, Inspection& result, FacetChanges& changes);
    void take_missed(std::size_t d, Inspection& result);  // by distances_[d]
    /// Means of crossings may be so far off the surface that a mesh with vertices on it is beyond the
    /// tolerance of them: those are set aside.
    void set_unreachable_aside(PackedCrossings& points);
    void measure_between(Surface::CrossingSequence points, const FrameMesh& mesh, Inspection& inspection);
    void forget_distances();
    double cutoff() const;
    /// `spacing` in resolutions.
    void doubt(const std::vector<Vec3>& places, double spacing, Inspection& inspection) const;

    const Surface& surface_;
    const SizingLimits& limits_;
    const CrossingGrid& crossings_;
    struct Expected {
        TriangleIndex triangles;  // of particles
        std::vector<FacetError> errors;
    };
    std::optional<Expected> expected_;                 // before the first inspection
    KeptFacets facets_;                                // of the last inspection
    std::shared_ptr<std::vector<FacetError>> errors_;  // of each
    std::optional<BetweenCrossings> between_crossings_;
    std::optional<BetweenCrossings::Changes> since_look_;  // between crossings; none: not known
    std::deque<CrossingGrid> between_;                     // points between crossings, as they were found
    std::vector<Surface::Crossing> unreachable_;
    std::deque<MeshDistances> distances_;   // to the facets: of the crossings, then of each of between_
    bool measured_ = false;                 // and kept up to date from then on
    std::vector<std::vector<int>> missed_;  // of each of distances_, ascending
    std::optional<LatticeSides> sides_;
    std::optional<std::optional<std::size_t>> component_count_;  // none: not counted yet
    std::optional<std::optional<std::vector<Box>>> components_;  // none: not looked for yet
    bool looked_at_topology_ = false;
};

/// Where particles are missing: at the dual crossings of triangles with too large an error, turned from the
/// surface's normals or, where it is smooth, with too small an angle; in the middle of the longest edge of
/// what is sharper than 18 degrees across a crease, if a resolution high or more; at crossings that are
/// missed; around nodes whose side is wrong; on complex edges.
std::vector<Shortage> shortages(const FrameMesh& mesh, const Inspection& inspection, const Tetrahedra& cells,
                                const Particles& particles, const Surface& surface,
                                const SizingLimits& limits);

/// The errors into the frame's row.
void report(const FrameMesh& mesh, const Inspection& inspection, const Surface& surface, TrackedFrame& frame);

}  // namespace isotrack
