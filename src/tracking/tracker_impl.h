// What a tracker knows between frames, and the steps that a frame is made of.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "isotrack/delaunay/tetrahedralisation.h"
#include "isotrack/meshing/convection.h"
#include "isotrack/sampling/cover.h"
#include "isotrack/sampling/population.h"
#include "isotrack/tracking/tracker.h"
#include "tracking/frame_work.h"
#include "tracking/inspection.h"
#include "tracking/last_mesh.h"

namespace isotrack {

/// How fast the population goes after the wanted spacing.
struct Pace {
    PopulationBand band;
    double thinning;
    int sweeps;
};

struct Tracker::Impl {
    TrackerOptions options;
    Particles particles;
    Id next_id = 0;
    std::unique_ptr<Tetrahedralisation> dt;
    CellLabels labels;
    std::vector<Id> in_dt;  // the particles whose DT it is
    Id first_astray = 0;    // those born since the particles were arranged
    Id first_of_frame = 0;  // those born since the last frame
    LastMesh last_mesh;

    explicit Impl(const TrackerOptions& o);

    UpdateStrategy strategy() const;
    /// Of the DT that meshes are carved from: in the paper's method the descent has another.
    UpdateStrategy mesh_strategy() const;

    /// What flips may leave of the tolerance; in the paper's method it has no say.
    std::optional<double> flips_within(const SizingLimits& l) const;

    /// Puts those next to each other in memory that are so in space: what looks at neighbours takes a third
    /// less time then.
    void arrange();
    bool astray() const;

    /// Brings the DT to the particles. `moved`: what was known of its cells does not hold any more.
    /// `meanwhile` runs beside it and may read the particles; `busy` threads are left to it where there was
    /// no DT before.
    void tetrahedralise(bool moved, std::map<std::string, double>& seconds,
                        const std::function<void()>& meanwhile = {}, int busy = 0);
    void bring_dt(bool moved, int threads);
    /// Frees the DT; the next is built anew.
    void forget_dt();
    /// Whether so many particles moved or came in this frame that the next DT is likely to be.
    bool will_build_anew() const;

    /// The mesh of the DT as it is, before any fit.
    FrameMesh carve_mesh(const Surface& surface, std::map<std::string, double>& seconds);

    /// Carves labels, which change where they are untangled.
    FrameMesh mesh_of(CellLabels& of_cells, const Surface& surface) const;

    Densifier make_densifier(const Surface& surface, const SizingLimits& l, std::size_t crossings);

    /// The newborn move like the neighbours that were there before, or like those of these; farther from all
    /// of them they rest.
    void inherit_velocities(const std::vector<Triangle>& triangles);

    /// Where nothing is thin the nodes of the lattice need not be looked at: the Euler number tells.
    bool is_thick(const FrameWork& work) const;
    /// Whether parts of a mesh may be exchanged for those of the lattice.
    bool patches() const;
    /// What looking at the nodes, and patching, will need of the surface alone. Reads no positions.
    void prepare_topology(FrameWork& work) const;

    void follow(FrameWork& work, const Pace& pace, bool warm);
    std::vector<char> restless(double detail) const;
    void retain(const std::vector<char>& keep);  // particles, and what is known of them
    void make_room(const Surface& surface, TrackedFrame& frame);
    void measure(FrameWork& work);
    void seed(FrameWork& work, const Sowing& sowing);
    bool has_flat_faces(const FrameWork& work) const;
    void sample(FrameWork& work, bool warm);
    void sample_as_in_paper(const Surface& surface, const SizingLimits& l, bool warm, TrackedFrame& frame);
    void place_particles(const Motion& motion, FrameWork& work);
    void name_vertices(const FrameMesh& mesh, TriangleMesh& named);
    class Making;
    Finish begin(const Surface& surface, const Motion& motion);
};

}  // namespace isotrack
