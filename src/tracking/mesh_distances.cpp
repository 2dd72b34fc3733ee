#include "tracking/mesh_distances.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "find_in_blocks.h"
#include "isotrack/meshing/certify.h"

namespace isotrack {

std::vector<Triangle> triangles_near_gone(const std::vector<Facet>& went, double reach,
                                          const std::vector<Vec3>& vertices,
                                          const std::vector<Triangle>& triangles) {
    Box box;
    for (const Facet& facet : went) box.extend(facet.box());
    if (box.isEmpty()) return {};
    const Box around(box.min() - Vec3::Constant(reach), box.max() + Vec3::Constant(reach));
    constexpr std::size_t kTrianglesPerBlock = 8192;
    return find_in_blocks<Triangle>(
        triangles.size(), kTrianglesPerBlock,
        [&](std::size_t begin, std::size_t end, std::vector<Triangle>& found) {
            for (std::size_t t = begin; t < end; ++t) {
                const auto& [i, j, k] = triangles[t];
                const Vec3 low = vertices[i].cwiseMin(vertices[j]).cwiseMin(vertices[k]),
                           high = vertices[i].cwiseMax(vertices[j]).cwiseMax(vertices[k]);
                if (around.intersects(Box(low, high))) found.push_back(triangles[t]);
            }
        });
}

std::optional<std::vector<int>> MeshDistances::measure(const std::vector<Vec3>& vertices,
                                                       const std::vector<Triangle>& triangles,
                                                       const FacetChanges& changes) {
    if (distances_.empty() || changes.many) {
        reach_ = cutoff_;
        distances_ = crossing_distances(vertices, triangles, points_, cutoff_);
        return std::nullopt;
    }
    // What was nearest to a triangle that went is to be measured again; what is nearer to one that came than
    // to all before is measured now.
    const double same = 1e-6 * cutoff_;  // ample for the rounding to floats
    const double reach = std::exchange(reach_, cutoff_);
    constexpr float kUnknown = -1.0f;
    constexpr std::size_t kFacetsPerBlock = 16;
    struct Near {
        int point;
        float distance;  // to the facet
    };
    // The points within a limit of facets, which goes with the distance measured; none that are unknown.
    const auto near = [&](const std::vector<Facet>& facets, const auto& limit_at) {
        const auto find = [&](std::size_t begin, std::size_t end, std::vector<Near>& found) {
            for (std::size_t f = begin; f < end; ++f) {
                const Vec3 a = facets[f].corner[0].cast<double>(), b = facets[f].corner[1].cast<double>(),
                           c = facets[f].corner[2].cast<double>(), around = Vec3::Constant(reach + same);
                const FacingTriangle triangle(a, b, c);
                const Box box(a.cwiseMin(b).cwiseMin(c) - around, a.cwiseMax(b).cwiseMax(c) + around);
                points_.for_each_in(box, [&](std::size_t i) {
                    const double limit = limit_at(distances_[i]), limit2 = limit * limit;
                    if (limit < 0.0) return;
                    const double d2 = triangle.squared_distance(points_[i], limit2);
                    if (d2 <= limit2)
                        found.push_back({static_cast<int>(i), std::sqrt(static_cast<float>(d2))});
                });
            }
        };
        return find_in_blocks<Near>(facets.size(), kFacetsPerBlock, find);
    };
    std::vector<int> unknown;
    for (const Near& n : near(changes.went, [&](double d) { return d + same; })) {
        if (distances_[n.point] == kUnknown) continue;
        distances_[n.point] = kUnknown;
        unknown.push_back(n.point);
    }
    std::vector<int> changed;
    for (const Near& n : near(changes.came, [&](double d) { return std::min(d, cutoff_); })) {
        distances_[n.point] = std::min(distances_[n.point], n.distance);
        changed.push_back(n.point);
    }
    crossing_distances(vertices, changes.around, points_, unknown, cutoff_, distances_);
    changed.insert(changed.end(), unknown.begin(), unknown.end());
    return changed;
}

MeshDistances::Survey MeshDistances::survey(double limit) {
    constexpr std::size_t kBlock = 32768;
    std::vector<Survey> blocks((distances_.size() + kBlock - 1) / kBlock);
    tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t b) {
        Survey& block = blocks[b];
        for (std::size_t i = b * kBlock; i < std::min(distances_.size(), (b + 1) * kBlock); ++i) {
            const double d = distances_[i];
            if (!(d <= limit)) block.beyond.push_back(static_cast<int>(i));
            if (!std::isfinite(d)) {
                ++block.lost;
                continue;
            }
            block.farthest = std::max(block.farthest, d);
            const double weight = points_[i].stands_for;
            block.sum_of_squares += weight * d * d;
            block.weight += weight;
        }
    });
    Survey result;
    for (const Survey& block : blocks) {
        result.beyond.insert(result.beyond.end(), block.beyond.begin(), block.beyond.end());
        result.lost += block.lost;
        result.farthest = std::max(result.farthest, block.farthest);
        result.sum_of_squares += block.sum_of_squares;
        result.weight += block.weight;
    }
    if (result.lost == 0) reach_ = result.farthest;
    return result;
}

}  // namespace isotrack
