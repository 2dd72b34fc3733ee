#include "tracking/mesh_trials.h"

#include <algorithm>
#include <utility>

#include "tracking/failing.h"

namespace isotrack {
namespace {

double largest_error(const Inspection& inspection) {
    double result = 0.0;
    for (const TriangleError& error : *inspection.errors) result = std::max(result, error.largest);
    return result;
}

}  // namespace

MeshTopology topology_of(const FrameMesh& mesh) {
    return mesh_topology({mesh.vertices, mesh.carved.triangles, {}, {}});
}

bool MeshTrials::try_mesh(FrameMesh other) {
    Inspection after = inspector_.inspect_both_ways(other);
    inspector_.look_between(other, after);
    const bool good =
        largest_error(after) <= std::max(kCertified * limits_.tolerance, largest_error(inspection_)) &&
        inspector_.newly_missed(after, mesh_.vertices, mesh_.carved.triangles).empty();
    if (good) {
        inspector_.inspect_topology(other, after);
        mesh_ = std::move(other);
        inspection_ = std::move(after);
    } else {
        inspector_.inspect_both_ways(mesh_);  // what it saw last was another
    }
    return good;
}

}  // namespace isotrack
