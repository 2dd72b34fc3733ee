#include "tracking/mesh_trials.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "tracking/failing.h"

namespace isotrack {
namespace {

double largest_of(const std::vector<FacetError>& errors) {
    double result = 0.0;
    for (const FacetError& error : errors) result = std::max<double>(result, error.largest);
    return result;
}

std::vector<Vec3> failing_in(const Inspection& inspection, double tolerance) {
    std::vector<Vec3> result;
    for (const FacetError& error : *inspection.errors)
        if (is_too_far(error, tolerance)) result.push_back(error.where.cast<double>());
    for (const Surface::Crossing& missed : inspection.missed) result.push_back(missed.point);
    for (const FacetError& error : *inspection.errors)
        if (error.turned_deg >= kTurnedOverDeg) result.push_back(error.where.cast<double>());
    return result;
}

}  // namespace

std::vector<Vec3> MeshTrials::failing_places() const {
    return failing_in(inspection_, limits_.tolerance);
}

bool MeshTrials::try_mesh(FrameMesh&& other) {
    return take_if_harmless(std::move(other), std::numeric_limits<std::size_t>::max());
}

bool MeshTrials::try_to_mend(FrameMesh&& other) {
    const std::size_t failing = failing_places().size();
    return failing > 0 && take_if_harmless(std::move(other), failing - 1);
}

bool MeshTrials::take_if_misses_less(FrameMesh&& other) {
    Inspection after = inspect(other);
    const bool good =
        after.missed.size() < inspection_.missed.size() && after.lost_crossings <= inspection_.lost_crossings;
    if (good)
        take(std::move(other), std::move(after));
    else
        look_back();
    return good;
}

void MeshTrials::put_back(FrameMesh mesh) {
    mesh_ = std::move(mesh);
    inspection_ = inspector_.inspect_both_ways(mesh_);
    is_topology_known_ = false;
}

const LatticeTopology& MeshTrials::topology() {
    if (!is_topology_known_) inspector_.inspect_topology(mesh_, inspection_);
    is_topology_known_ = true;
    return inspection_.topology;
}

double MeshTrials::largest_allowed() const {
    return std::max(kCertified * limits_.tolerance, largest_of(*inspection_.errors));
}

bool MeshTrials::may_have(const std::vector<Vec3>& corners) const {
    return largest_of(inspector_.errors_of(corners)) <= largest_allowed();
}

Inspection MeshTrials::inspect(const FrameMesh& mesh) const {
    Inspection result = inspector_.inspect_both_ways(mesh);
    inspector_.look_between(mesh, result);
    return result;
}

void MeshTrials::look_back() {
    // It may have looked at more points for the other.
    Inspection now = inspector_.inspect_both_ways(mesh_);
    now.topology = std::move(inspection_.topology);
    now.doubts = std::move(inspection_.doubts);
    inspection_ = std::move(now);
}

MeshTrials::Outlook MeshTrials::look_at(const FrameMesh& other) {
    const Inspection after = inspect(other);
    Outlook result{failing_in(after, limits_.tolerance), {}};
    for (const auto& c : inspector_.newly_missed(after, mesh_.vertices, mesh_.carved.triangles))
        result.newly_missed.push_back(c.point);
    look_back();
    return result;
}

bool MeshTrials::take_if_harmless(FrameMesh&& other, std::size_t most_failing) {
    Inspection after = inspect(other);
    const bool good = largest_of(*after.errors) <= largest_allowed() &&
                      after.farthest_crossing <= std::max(limits_.tolerance, inspection_.farthest_crossing) &&
                      after.lost_crossings <= inspection_.lost_crossings &&
                      failing_in(after, limits_.tolerance).size() <= most_failing &&
                      inspector_.newly_missed(after, mesh_.vertices, mesh_.carved.triangles).empty();
    if (good)
        take(std::move(other), std::move(after));
    else
        look_back();
    return good;
}

void MeshTrials::take(FrameMesh&& other, Inspection&& after) {
    mesh_ = std::move(other);
    inspection_ = std::move(after);
    is_topology_known_ = false;
}

}  // namespace isotrack
