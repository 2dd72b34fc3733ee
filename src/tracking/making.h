// The mesh of one frame, from particles in place on.
#pragma once

#include <optional>

#include "tracking/fitted.h"
#include "tracking/tracker_impl.h"

namespace isotrack {

/// A frame on its way from particles in place to a mesh that passes. All references must outlive it; `work`
/// has its inspector.
class Tracker::Impl::Making {
public:
    Making(Impl& tracker, FrameWork& work) : tracker_(tracker), work_(work) {}

    /// Meshes the particles. Once, when many have to be added, their surroundings make room for them: of the
    /// particles of a new sampling, and under a fit, fewer count as many.
    void mesh_particles();
    /// Adds particles, and changes labels, until the mesh passes or nothing more can be done. The topology,
    /// which takes longer to look at, is looked at when all else passes, and so is what lies between
    /// crossings.
    void certify();
    /// Exchanges parts of the mesh for those of the lattice, with no more vertices than they need; all of it
    /// where it fails nearly everywhere. Needs no DT.
    void patch();
    /// Whether the mesh is that of the particles, whatever parts of it were exchanged.
    bool is_of_particles() const { return is_of_particles_; }

private:
    const TrackerOptions& options() const { return tracker_.options; }
    Particles& particles() { return tracker_.particles; }
    const Tetrahedra& cells() const { return tracker_.dt->cells(); }
    bool in_paper() const { return options().method == Method::Paper; }
    bool guided() const { return !in_paper() && options().reconstruction == Reconstruction::Guided; }

    void make_mesh();
    void inspect_both_ways() {
        work_.inspection = {};  // first: there are many errors
        work_.inspection = work_.inspector->inspect_both_ways(work_.mesh);
    }
    bool has_topology() const {
        return guided() && tracker_.is_thick(work_) && work_.surface.lattice_euler() == euler_of(work_.mesh);
    }
    /// Adds particles where the mesh fails. Returns how many; 0 when it passes or nothing more can be done.
    std::size_t mend() {
        return densifier_->add(
            shortages(work_.mesh, work_.inspection, cells(), particles(), work_.surface, work_.limits));
    }
    /// Whether nothing is added and no label changes.
    bool passes();
    void insert_added();
    void mend_components();  // which may find more that is missed

    Impl& tracker_;
    FrameWork& work_;
    Fitted fitted_;
    std::optional<Densifier> densifier_;  // none in the paper's method, which mends nothing
    std::size_t added_ = 0;
    int relabellings_ = 0;
    bool is_of_particles_ = true;
};

}  // namespace isotrack
