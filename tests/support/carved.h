// Meshes of a surface made simply, whose labels can be spoilt.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "isotrack/meshing/convection.h"
#include "isotrack/meshing/mesh_topology.h"
#include "support/samples.h"
#include "tracking/inspection.h"
#include "tracking/mesh_trials.h"
#include "tracking/relabelling.h"
#include "tracking/specks.h"

namespace isotrack::support {

constexpr double kResolution = 0.05, kEdge = 0.2;

/// Seeds on a surface, their DT, and the mesh carved from it.
struct Carved : Samples {
    const Surface& surface;
    CellLabels labels;

    Carved(const Surface& of, double tolerance, double edge = kEdge) : Samples(of, edge), surface(of) {
        limits.tolerance = tolerance;
        limits.detail = surface.resolution();
        labels = guided_convection(cells, particles.position, particles.normal, surface);
    }
    FrameMesh mesh() const {
        FrameMesh result;
        result.carved = carve(cells, labels, particles.position);
        result.vertices = mesh_of(result.carved, particles.position).points;
        return result;
    }
    Carve carve_labels() {
        return [this](CellLabels& of_cells) {
            labels = of_cells;
            return mesh();
        };
    }
    Inspection inspect(const FrameMesh& mesh) const {
        Inspection result;
        const auto errors = triangle_errors(mesh.vertices, mesh.carved.triangles, surface, 6);
        result.errors = std::make_shared<const std::vector<FacetError>>(errors.begin(), errors.end());
        return result;
    }
    Vec3 centroid(int cell) const {
        Vec3 sum = Vec3::Zero();
        for (const int v : cells.vertices[cell]) sum += particles.position[v];
        return sum / 4.0;
    }
    std::size_t relabel() {
        const FrameMesh now = mesh();
        return isotrack::relabel(labels, cells, now, inspect(now), particles, surface, limits);
    }
};

/// Of the triangles.
inline MeshTopology topology_of(const FrameMesh& mesh) {
    return mesh_topology({mesh.vertices, mesh.carved.triangles, {}, {}});
}

/// A mesh, its inspection with all that there is to look at, and trials of others.
struct Inspected {
    CrossingGrid crossings;
    Inspector inspector;
    Inspection inspection;
    MeshTrials trials;

    Inspected(const Carved& carved, FrameMesh& mesh) : Inspected(carved.surface, carved.limits, mesh) {}
    Inspected(const Surface& surface, const SizingLimits& limits, FrameMesh& mesh)
        : crossings(surface),
          inspector(surface, limits, crossings),
          inspection(inspector.inspect_both_ways(mesh)),
          trials(mesh, inspection, inspector, limits) {
        inspector.look_between(mesh, inspection);
        inspector.inspect_topology(mesh, inspection);
    }
};

}  // namespace isotrack::support
