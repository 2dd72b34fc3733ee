#include "tracking/handles.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "isotrack/meshing/mesh_topology.h"
#include "meshing/small_handles.h"
#include "sampling/compact.h"
#include "tracking/failing.h"

namespace isotrack {
namespace {

constexpr double kSmall = 3.5;           // resolutions: reach of the pieces of the mesh that are looked at
constexpr double kReach = 2.5;           // resolutions: of what may change around a place
constexpr double kThin = 2.0;            // resolutions: sheets no farther apart
constexpr double kApart = 2.0;           // resolutions: places that near are one
constexpr std::size_t kMostPlaces = 12;  // of which each may take some meshes
constexpr double kUnclear[] = {0.05, 0.1, 0.2};  // resolutions: a centroid so near does not tell the side

/// Of the triangles whose flag is set.
MeshTopology topology_of(const FrameMesh& mesh, const std::vector<char>& some) {
    TriangleMesh part{mesh.vertices, mesh.carved.triangles, {}, {}};
    compact(part.triangles, some);
    return mesh_topology(part);
}

std::vector<Vec3> suspicious_places(const FrameMesh& mesh, const std::vector<double>& thickness,
                                    double resolution) {
    std::vector<char> at_thin;
    for (const int p : mesh.carved.particle) at_thin.push_back(p >= 0 && thickness[p] < kThin * resolution);
    std::vector<Vec3> result;
    for (const int v : small_handles(mesh.vertices, mesh.carved.triangles, at_thin, kSmall * resolution)) {
        if (result.size() == kMostPlaces) break;
        const Vec3& place = mesh.vertices[v];
        if (std::none_of(result.begin(), result.end(),
                         [&](const Vec3& other) { return (other - place).norm() < kApart * resolution; }))
            result.push_back(place);
    }
    return result;
}

/// The cells between sheets near a place, and how far their centroids are from the surface; nearest first.
std::vector<std::pair<double, int>> cells_between(const Vec3& place, const Tetrahedra& cells,
                                                  const Particles& particles, const Surface& surface) {
    const auto probe = surface.probe();
    const double reach = kReach * surface.resolution();
    std::vector<std::pair<double, int>> result;
    for (int c = 0; c < static_cast<int>(cells.size()); ++c) {
        if (cells.is_infinite(c)) continue;
        const auto& v = cells.vertices[c];
        Vec3 centroid = Vec3::Zero();
        for (const int i : v) centroid += 0.25 * particles.position[i];
        if ((centroid - place).squaredNorm() > reach * reach) continue;
        const bool one_sheet = std::all_of(v.begin(), v.end(), [&](int i) {
            return std::all_of(v.begin(), v.end(),
                               [&](int j) { return particles.normal[i].dot(particles.normal[j]) >= 0.0; });
        });
        if (!one_sheet) result.emplace_back(std::abs(probe->value(centroid)), c);
    }
    std::sort(result.begin(), result.end());
    return result;
}

bool reaches_as_much(const Inspection& after, const Inspection& before, double tolerance) {
    const auto farthest = [](const Inspection& inspection) {
        double result = 0.0;
        for (const TriangleError& error : *inspection.errors) result = std::max(result, error.largest);
        return result;
    };
    return after.missed.size() <= before.missed.size() && after.lost_crossings <= before.lost_crossings &&
           after.topology.faults.size() <= before.topology.faults.size() &&
           after.topology.parted.size() <= before.topology.parted.size() &&
           farthest(after) <= std::max(kCertified * tolerance, farthest(before));
}

}  // namespace

std::size_t mend_handles(CellLabels& labels, const Tetrahedra& cells, FrameMesh& mesh, Inspection& inspection,
                         Inspector& inspector, const Particles& particles,
                         const std::vector<double>& thickness, const Surface& surface,
                         const SizingLimits& limits,
                         const std::function<FrameMesh(CellLabels&)>& carve_labels,
                         const std::function<void(FrameMesh&)>& fit) {
    const std::vector<Vec3> places = suspicious_places(mesh, thickness, surface.resolution());
    if (places.empty()) return 0;
    std::optional<long> wanted = surface.lattice_euler();
    if (!wanted) return 0;
    *wanted += topology_of(mesh, inspection.topology.speck).euler;  // which will be left out
    MeshTopology now = topology_of(mesh, std::vector<char>(mesh.carved.triangles.size(), 1));
    if (now.euler >= *wanted) return 0;
    const auto mend_at = [&](const Vec3& place) {
        if (now.euler >= *wanted) return false;
        const auto between = cells_between(place, cells, particles, surface);
        std::size_t tried[2] = {0, 0};  // how many cells, from outside and from inside
        for (const double unclear : kUnclear)
            for (const char from : {0, 1}) {
                CellLabels changed = labels;
                std::size_t count = 0;
                for (const auto& [distance, c] : between) {
                    if (distance > unclear * surface.resolution() || labels[c] != from) continue;
                    changed[c] = !from;
                    ++count;
                }
                if (count == tried[static_cast<int>(from)]) continue;
                tried[static_cast<int>(from)] = count;
                FrameMesh other = carve_labels(changed);
                const MeshTopology then =
                    topology_of(other, std::vector<char>(other.carved.triangles.size(), 1));
                if (then.euler <= now.euler || then.euler > *wanted || then.components != now.components)
                    continue;
                fit(other);
                Inspection after = inspector.inspect_both_ways(other);
                inspector.inspect_topology(other, after);
                if (!reaches_as_much(after, inspection, limits.tolerance)) continue;
                now = then;
                labels = std::move(changed);
                mesh = std::move(other);
                inspection = std::move(after);
                return true;
            }
        return false;
    };
    const auto mended = std::count_if(places.begin(), places.end(), mend_at);
    inspector.inspect_both_ways(mesh);  // what it saw last may have been another
    return static_cast<std::size_t>(mended);
}

}  // namespace isotrack
