#include "tracking/mesh_distances.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "isotrack/meshing/certify.h"

namespace isotrack {

void MeshDistances::measure(const std::vector<Vec3>& vertices, const std::vector<Triangle>& triangles,
                            const FacetChanges& changes) {
    if (distances_.empty() || changes.many) {
        distances_ = crossing_distances(vertices, triangles, points_, cutoff_);
        return;
    }
    // What was nearest to a triangle that went is to be measured again; what is nearer to one that came than
    // to all before is measured now.
    const double same = 1e-6 * cutoff_;  // ample for the rounding to floats
    const Survey before = survey(cutoff_);
    const double reach = before.lost > 0 ? cutoff_ : before.farthest;
    constexpr float kUnknown = -1.0f;
    const auto for_each_near = [&](const Facet& facet, const auto& body) {
        const auto& [a, b, c] = facet.corner;
        const Vec3 around = Vec3::Constant(reach + same),
                   low = a.cwiseMin(b).cwiseMin(c).cast<double>() - around,
                   high = a.cwiseMax(b).cwiseMax(c).cast<double>() + around;
        const FacingTriangle triangle(a.cast<double>(), b.cast<double>(), c.cast<double>());
        points_.for_each_in(Box(low, high), [&](std::size_t i) {
            if (distances_[i] != kUnknown) body(triangle, i);
        });
    };
    std::vector<int> unknown;
    for (const Facet& facet : changes.went)
        for_each_near(facet, [&](const FacingTriangle& triangle, std::size_t i) {
            const double d = distances_[i] + same;
            if (triangle.squared_distance(points_[i], d * d) > d * d) return;
            distances_[i] = kUnknown;
            unknown.push_back(static_cast<int>(i));
        });
    for (const Facet& facet : changes.came)
        for_each_near(facet, [&](const FacingTriangle& triangle, std::size_t i) {
            const double limit = std::min<double>(distances_[i], cutoff_),
                         d2 = triangle.squared_distance(points_[i], limit * limit);
            if (d2 < limit * limit) distances_[i] = static_cast<float>(std::sqrt(d2));
        });
    crossing_distances(vertices, triangles, points_, unknown, cutoff_, distances_);
}

MeshDistances::Survey MeshDistances::survey(double limit) const {
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
            block.sum_of_squares += d * d;
        }
    });
    Survey result;
    for (const Survey& block : blocks) {
        result.beyond.insert(result.beyond.end(), block.beyond.begin(), block.beyond.end());
        result.lost += block.lost;
        result.farthest = std::max(result.farthest, block.farthest);
        result.sum_of_squares += block.sum_of_squares;
    }
    return result;
}

}  // namespace isotrack
