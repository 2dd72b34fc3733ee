// Other labels for the last mesh of a frame.
#pragma once

#include <functional>
#include <utility>

#include "isotrack/meshing/convection.h"
#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/sampling/sizing.h"
#include "tracking/inspection.h"

namespace isotrack {

/// A mesh, the labels that it was carved from, and its inspection, with what lies between crossings and the
/// topology. What is tried stays where it does no harm. All references must outlive it.
class LabelTrials {
public:
    /// Carves labels, which may change; fits what was carved.
    using Carve = std::function<FrameMesh(CellLabels&)>;
    using Fit = std::function<void(FrameMesh&)>;

    LabelTrials(CellLabels& labels, FrameMesh& mesh, Inspection& inspection, Inspector& inspector,
                const SizingLimits& limits, Carve carve, Fit fit)
        : labels_(labels),
          mesh_(mesh),
          inspection_(inspection),
          inspector_(inspector),
          limits_(limits),
          carve_(std::move(carve)),
          fit_(std::move(fit)) {}

    const CellLabels& labels() const { return labels_; }
    const FrameMesh& mesh() const { return mesh_; }
    const Inspection& inspection() const { return inspection_; }
    /// It saw the mesh last.
    Inspector& inspector() { return inspector_; }

    /// Takes other labels if their mesh has a topology that `is_wanted`, if it misses nothing that the mesh
    /// does not, if its largest error is within the tolerance or no larger, and if no more nodes are on a
    /// wrong side and no more diagonals parted; not the last when it `joins` parts that were apart, between
    /// which nodes may stay outside. Returns whether it did.
    bool try_labels(CellLabels changed, bool joins,
                    const std::function<bool(const MeshTopology&)>& is_wanted);

private:
    CellLabels& labels_;
    FrameMesh& mesh_;
    Inspection& inspection_;
    Inspector& inspector_;
    const SizingLimits& limits_;
    Carve carve_;
    Fit fit_;
};

/// Of the triangles whose flag is set; of all of them.
MeshTopology topology_of(const FrameMesh& mesh, const std::vector<char>& some);
MeshTopology topology_of(const FrameMesh& mesh);

}  // namespace isotrack
