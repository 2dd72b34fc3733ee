// Other meshes instead of the last one of a frame.
#pragma once

#include "isotrack/sampling/sizing.h"
#include "tracking/inspection.h"

namespace isotrack {

/// A mesh and its inspection, with what lies between crossings and the topology. What is tried stays where
/// it does no harm. All references must outlive it.
class MeshTrials {
public:
    MeshTrials(FrameMesh& mesh, Inspection& inspection, Inspector& inspector, const SizingLimits& limits)
        : mesh_(mesh), inspection_(inspection), inspector_(inspector), limits_(limits) {}

    const FrameMesh& mesh() const { return mesh_; }
    /// Without its topology.
    const Inspection& inspection() const { return inspection_; }
    /// Looked at when it is asked for: it takes as long as a trial.
    const LatticeTopology& topology();
    /// It saw the mesh last.
    Inspector& inspector() { return inspector_; }

    /// Takes a mesh if it misses nothing that the one there does not, and if its largest distances either way
    /// are within the tolerance or no larger. Returns whether it did; if not, `other` is as it was.
    bool try_mesh(FrameMesh&& other);
    /// Takes a mesh if moreover it fails at fewer places.
    bool try_to_mend(FrameMesh&& other);
    /// Takes a mesh if it misses less of the surface and loses no more, however far off its triangles are.
    bool take_if_misses_less(FrameMesh&& other);
    /// Where another mesh fails, and what it misses that the one there does not. That stays.
    struct Outlook {
        std::vector<Vec3> failing, newly_missed;
    };
    Outlook look_at(const FrameMesh& other);
    /// Takes a mesh that was there before.
    void put_back(FrameMesh mesh);
    /// Whether triangles, of three corners each, are near enough to the surface for a mesh that is taken.
    bool may_have(const std::vector<Vec3>& corners) const;
    /// Where a triangle is too far off, what is missed, and where a triangle is turned over.
    std::vector<Vec3> failing_places() const;

private:
    double largest_allowed() const;
    Inspection inspect(const FrameMesh& mesh) const;
    void look_back();  // at the mesh there, after another
    bool take_if_harmless(FrameMesh&& other, std::size_t most_failing);
    void take(FrameMesh&& other, Inspection&& after);

    FrameMesh& mesh_;
    Inspection& inspection_;
    Inspector& inspector_;
    const SizingLimits& limits_;
    bool is_topology_known_ = true;
};

}  // namespace isotrack
