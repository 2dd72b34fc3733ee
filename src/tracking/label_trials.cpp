#include "tracking/label_trials.h"

#include <algorithm>
#include <utility>

#include "sampling/compact.h"
#include "tracking/failing.h"

namespace isotrack {
namespace {

bool is_as_good(const Inspection& after, const Inspection& before, bool joins, double tolerance) {
    const auto farthest = [](const Inspection& inspection) {
        double result = 0.0;
        for (const TriangleError& error : *inspection.errors) result = std::max(result, error.largest);
        return result;
    };
    return (joins || (after.topology.faults.size() <= before.topology.faults.size() &&
                      after.topology.parted.size() <= before.topology.parted.size())) &&
           farthest(after) <= std::max(kCertified * tolerance, farthest(before));
}

}  // namespace

MeshTopology topology_of(const FrameMesh& mesh, const std::vector<char>& some) {
    TriangleMesh part{mesh.vertices, mesh.carved.triangles, {}, {}};
    compact(part.triangles, some);
    return mesh_topology(part);
}
MeshTopology topology_of(const FrameMesh& mesh) {
    return mesh_topology({mesh.vertices, mesh.carved.triangles, {}, {}});
}

bool LabelTrials::try_labels(CellLabels changed, bool joins,
                             const std::function<bool(const MeshTopology&)>& is_wanted) {
    FrameMesh other = carve_(changed);
    if (!is_wanted(topology_of(other))) return false;
    fit_(other);
    Inspection after = inspector_.inspect_both_ways(other);
    inspector_.look_between(other, after);
    inspector_.inspect_topology(other, after);
    const bool good = is_as_good(after, inspection_, joins, limits_.tolerance) &&
                      inspector_.newly_missed(after, mesh_.vertices, mesh_.carved.triangles).empty();
    if (good) {
        labels_ = std::move(changed);
        mesh_ = std::move(other);
        inspection_ = std::move(after);
    } else {
        inspector_.inspect_both_ways(mesh_);  // what it saw last was another
    }
    return good;
}

}  // namespace isotrack
