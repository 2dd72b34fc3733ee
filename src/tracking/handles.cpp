#include "tracking/handles.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "meshing/small_handles.h"
#include "tracking/cell_centroid.h"

namespace isotrack {
namespace {

constexpr double kSmall = 3.5;           // resolutions: reach of the pieces of the mesh that are looked at
constexpr double kReach = 2.5;           // resolutions: of what may change around a place
constexpr double kThin = 2.0;            // resolutions: sheets no farther apart
constexpr double kApart = 2.0;           // resolutions: places that near are one
constexpr std::size_t kMostPlaces = 12;  // of which each may take some meshes
constexpr double kUnclear[] = {0.05, 0.1, 0.2};  // resolutions: a centroid so near does not tell the side

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
        const Vec3 centroid = centroid_of(c, cells, particles);
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

}  // namespace

std::size_t mend_handles(LabelTrials& trials, const Tetrahedra& cells, const Particles& particles,
                         const std::vector<double>& thickness, const Surface& surface) {
    const std::vector<Vec3> places = suspicious_places(trials.mesh(), thickness, surface.resolution());
    if (places.empty()) return 0;
    std::optional<long> wanted = surface.lattice_euler();
    if (!wanted) return 0;
    *wanted +=
        topology_of(trials.mesh(), trials.inspection().topology.speck).euler;  // which will be left out
    MeshTopology now = topology_of(trials.mesh());
    const auto mend_at = [&](const Vec3& place) {
        if (now.euler >= *wanted) return false;
        const auto between = cells_between(place, cells, particles, surface);
        std::size_t tried[2] = {0, 0};  // how many cells, from outside and from inside
        for (const double unclear : kUnclear)
            for (const char from : {0, 1}) {
                CellLabels changed = trials.labels();
                std::size_t count = 0;
                for (const auto& [distance, c] : between) {
                    if (distance > unclear * surface.resolution() || changed[c] != from) continue;
                    changed[c] = !from;
                    ++count;
                }
                if (count == tried[static_cast<int>(from)]) continue;
                tried[static_cast<int>(from)] = count;
                MeshTopology then;
                if (trials.try_labels(std::move(changed), false, [&](const MeshTopology& topology) {
                        then = topology;
                        return then.euler > now.euler && then.euler <= *wanted &&
                               then.components == now.components;
                    })) {
                    now = then;
                    return true;
                }
            }
        return false;
    };
    return static_cast<std::size_t>(std::count_if(places.begin(), places.end(), mend_at));
}

}  // namespace isotrack
