#include "tracking/patches.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "component_boxes.h"
#include "isotrack/meshing/self_intersections.h"
#include "meshing/patch.h"
#include "meshing/small_handles.h"
#include "sampling/compact.h"

namespace isotrack {
namespace {

// All in resolutions.
constexpr double kSmall = 3.5;  // reach of the pieces of the mesh that are looked at
constexpr double kThin = 2.0;   // sheets no farther apart
constexpr double kApart = 1.5;  // places that near are one
constexpr double kReaches[] = {1.0, 1.5, 2.0, 2.7, 3.5, 4.7, 6.0, 8.0};
constexpr double kHarmlessReach = 2.0;
constexpr std::size_t kFewPlaces = 4;
constexpr double kLatticeReach = 24.0;
constexpr double kFarthestFailing = 3.5;
constexpr std::size_t kMostFailing = 64;
constexpr std::size_t kMostWork = 20000000;  // triangles looked at, each as often as it is

/// Those of some places that are not near to one before.
std::vector<Vec3> apart(const std::vector<Vec3>& places, double distance) {
    std::vector<Vec3> result;
    for (const Vec3& place : places)
        if (std::none_of(result.begin(), result.end(),
                         [&](const Vec3& other) { return (other - place).norm() < distance; }))
            result.push_back(place);
    return result;
}

/// Where the mesh may have another topology than the lattice.
std::vector<Vec3> suspicious_places(const FrameMesh& mesh, const LatticeTopology& topology,
                                    const std::vector<double>& thickness, double resolution) {
    std::vector<Vec3> result = topology.faults;
    for (const auto& diagonal : topology.parted) result.push_back(0.5 * (diagonal.from + diagonal.to));
    for (std::size_t t = 0; t < topology.speck.size(); ++t)
        if (topology.speck[t]) result.push_back(mesh.vertices[mesh.carved.triangles[t][0]]);
    std::vector<char> at_thin;
    for (const int p : mesh.carved.particle) at_thin.push_back(p >= 0 && thickness[p] < kThin * resolution);
    for (const int v : small_handles(mesh.vertices, mesh.carved.triangles, at_thin, kSmall * resolution))
        result.push_back(mesh.vertices[v]);
    return apart(result, kApart * resolution);
}

/// The small components of mesh or lattice that the other does not have.
std::vector<Vec3> unmatched_components(const FrameMesh& mesh, const std::vector<Box>& of_lattice,
                                       double resolution) {
    std::vector<Vec3> ours, theirs, result;
    const auto take_small = [&](const std::vector<Box>& boxes, std::vector<Vec3>& middles) {
        for (const Box& box : boxes)
            if (box.sizes().maxCoeff() < kSmall * resolution) middles.push_back(box.center());
    };
    take_small(component_boxes<3>(mesh.vertices, mesh.carved.triangles), ours);
    take_small(of_lattice, theirs);
    if (ours.size() * theirs.size() > kMostWork) return result;
    const auto take_unmatched = [&](const std::vector<Vec3>& some, const std::vector<Vec3>& others) {
        for (const Vec3& one : some)
            if (std::none_of(others.begin(), others.end(),
                             [&](const Vec3& other) { return (other - one).norm() < resolution; }))
                result.push_back(one);
    };
    take_unmatched(ours, theirs);
    take_unmatched(theirs, ours);
    return result;
}

FrameMesh patched(FrameMesh mesh, const Patch& patch) {
    append(mesh, patch.points, patch.triangles);
    std::vector<char> gone = patch.gone;
    gone.resize(mesh.carved.triangles.size(), 0);
    return without(mesh, gone);
}

/// Whether a patch crosses the rest of its mesh or itself.
bool crosses(const Patch& patch, const FrameMesh& mesh) {
    std::vector<Vec3> points = mesh.vertices;
    points.insert(points.end(), patch.points.begin(), patch.points.end());
    std::vector<char> stays;
    for (const char gone : patch.gone) stays.push_back(!gone);
    std::vector<Triangle> rest = mesh.carved.triangles;
    compact(rest, stays);
    return any_cross(points, patch.triangles, rest);
}

/// Whether there are only a few, where patches would change nothing: the numbers of the whole lattice are
/// dearer.
bool are_harmless(const std::vector<Vec3>& places, const FrameMesh& mesh, const Surface& surface) {
    if (places.size() > kFewPlaces) return false;
    const double resolution = surface.resolution();
    const TriangleMesh lattice = surface.lattice_mesh(places, 4.0 * kHarmlessReach * resolution);
    return std::all_of(places.begin(), places.end(), [&](const Vec3& place) {
        const auto patch = patch_around(place, kHarmlessReach * resolution, mesh.vertices,
                                        mesh.carved.triangles, lattice, resolution);
        return patch && patch->euler == 0;
    });
}

bool is_sound(const MeshTopology& topology) {
    return topology.closed() && topology.oriented() && topology.manifold();
}

}  // namespace

std::size_t patch_topology(MeshTrials& trials, const std::vector<double>& thickness, const Surface& surface) {
    const double resolution = surface.resolution();
    std::vector<Vec3> places =
        suspicious_places(trials.mesh(), trials.inspection().topology, thickness, resolution);
    if (places.empty() || are_harmless(places, trials.mesh(), surface)) return 0;
    const auto wanted = surface.lattice_numbers();
    if (!wanted) return 0;
    // Components and handles that are too many or too few.
    const auto astray = [&](const MeshTopology& topology) {
        const long components =
                       static_cast<long>(topology.components) - static_cast<long>(wanted->components.size()),
                   handles = components - (topology.euler - wanted->euler) / 2;
        return std::abs(components) + std::abs(handles);
    };
    long now = astray(topology_of(trials.mesh()));
    if (now == 0) return 0;
    const std::vector<Vec3> unmatched = unmatched_components(trials.mesh(), wanted->components, resolution);
    places.insert(places.end(), unmatched.begin(), unmatched.end());
    const TriangleMesh lattice = surface.lattice_mesh(places, kLatticeReach * resolution);
    std::size_t count = 0, work = 0;
    std::vector<Vec3> around;  // places where a patch would be right, but did not fit
    const auto patch_at = [&](const Vec3& place, double reach) {
        const auto patch = patch_around(place, reach, trials.mesh().vertices, trials.mesh().carved.triangles,
                                        lattice, resolution);
        work += trials.mesh().carved.triangles.size();
        if (!patch || patch->euler == 0) return;
        FrameMesh other = patched(trials.mesh(), *patch);
        const MeshTopology topology = topology_of(other);
        const long then = astray(topology);
        if (then >= now || !is_sound(topology)) return;
        if (crosses(*patch, trials.mesh()) || !trials.try_mesh(std::move(other))) {
            for (const Vec3& v : trials.mesh().vertices)
                if ((v - place).norm() < reach) around.push_back(v);
            return;
        }
        ++count;
        now = then;
    };
    const auto patch_near = [&](const std::vector<Vec3>& some) {
        for (const double reach : kReaches)
            for (const Vec3& place : some)
                if (now > 0 && work < kMostWork) patch_at(place, reach * resolution);
    };
    patch_near(places);
    patch_near(apart(std::exchange(around, {}), kApart * resolution));
    return count;
}

std::size_t patch_failing(MeshTrials& trials, const Surface& surface) {
    const double resolution = surface.resolution();
    const std::vector<Vec3> places = apart(trials.failing_places(), kApart * resolution);
    if (places.empty() || places.size() > kMostFailing) return 0;
    const TriangleMesh lattice = surface.lattice_mesh(places, kLatticeReach * resolution);
    const std::size_t components = topology_of(trials.mesh()).components;
    const auto is_mended = [&](const Vec3& place) {
        const std::vector<Vec3> failing = trials.failing_places();
        return std::none_of(failing.begin(), failing.end(),
                            [&](const Vec3& other) { return (other - place).norm() < kApart * resolution; });
    };
    std::size_t count = 0;
    for (const double reach : kReaches)
        for (const Vec3& place : places) {
            if (reach > kFarthestFailing || is_mended(place)) continue;
            const auto patch = patch_around(place, reach * resolution, trials.mesh().vertices,
                                            trials.mesh().carved.triangles, lattice, resolution);
            if (!patch || patch->euler != 0) continue;
            FrameMesh other = patched(trials.mesh(), *patch);
            const MeshTopology topology = topology_of(other);
            if (!is_sound(topology) || topology.components != components || crosses(*patch, trials.mesh()))
                continue;
            if (trials.try_to_mend(std::move(other))) ++count;
        }
    return count;
}

}  // namespace isotrack
