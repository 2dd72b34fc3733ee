#include "tracking/between_crossings.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include "find_in_blocks.h"
#include "parallel_for_each.h"
#include "tracking/failing.h"

namespace isotrack {
namespace {

// Of a crossing whose surroundings are looked at: of the tolerance; or so many spacings of the crossings less
// than it, as the surface between them may be farther off. The larger counts.
constexpr double kNearlyTooFar = 0.8, kNearlyAtFolds = 0.1;
constexpr double kFarther = 0.1, kFartherAtFolds = 0.45;  // the latter where some stand for others
// Where none stands for others: times the sine of half the angle between the normals at a fold, as on its
// inner side the middle between two crossings, each near a triangle of its own, is up to half the way between
// them times that farther off. Some ways are longer than a spacing; that misses no more was measured.
constexpr double kFartherBetween = 0.5;
// Spacings: so far around lie those that a crossing stands for.
constexpr double kStandsForWithin = 0.5, kStandsForOnFlat = 2.0;
constexpr double kFold = 0.9;  // cosine between a triangle's normal and that of a corner

constexpr std::size_t kGrain = 1024;

/// For each vertex the sine of the largest angle between the normal of a triangle there and its own, 0 where
/// they meet nearly flat.
std::vector<float> turns_at_vertices(const std::vector<Vec3>& vertices,
                                     const std::vector<Triangle>& triangles) {
    std::vector<Eigen::Vector3f> area(triangles.size());
    parallel_for_each(triangles.size(), kGrain, [&](std::size_t t) {
        const auto& [i, j, k] = triangles[t];
        area[t] = (vertices[j] - vertices[i]).cross(vertices[k] - vertices[i]).cast<float>();
    });
    std::vector<Eigen::Vector3f> sum(vertices.size(), Eigen::Vector3f::Zero());
    for (std::size_t t = 0; t < triangles.size(); ++t)
        for (const int v : triangles[t]) sum[v] += area[t];
    std::vector<std::array<float, 3>> turn(triangles.size(), {0.0f, 0.0f, 0.0f});  // at each corner
    parallel_for_each(triangles.size(), kGrain, [&](std::size_t t) {
        for (int k = 0; k < 3; ++k) {
            const Eigen::Vector3f& normal = sum[triangles[t][k]];
            const float dot = area[t].dot(normal), norms = area[t].norm() * normal.norm();
            if (dot >= kFold * norms) continue;
            turn[t][k] = dot > 0.0f ? std::sqrt(1.0f - dot / norms * (dot / norms)) : 1.0f;
        }
    });
    std::vector<float> result(vertices.size(), 0.0f);
    for (std::size_t t = 0; t < triangles.size(); ++t)
        for (int k = 0; k < 3; ++k) result[triangles[t][k]] = std::max(result[triangles[t][k]], turn[t][k]);
    return result;
}

}  // namespace

std::vector<Surface::Crossing> BetweenCrossings::points(const std::vector<Vec3>& vertices,
                                                        const std::vector<Triangle>& triangles,
                                                        const MeshDistances& at_crossings) {
    std::vector<std::atomic<char>> at_fold(crossings_.size());  // and nearly too far off for it
    const std::vector<float> turns = turns_at_vertices(vertices, triangles);
    const double spacing = crossings_.spacing();
    const bool thinned_out = crossings_.thinned_out(surface_);
    const Vec3 reach = Vec3::Constant(tolerance_);
    parallel_for_each(triangles.size(), kGrain, [&](std::size_t t) {
        const auto& [i, j, k] = triangles[t];
        const double turn = std::max({turns[i], turns[j], turns[k]});
        if (turn == 0.0) return;
        const double farther = thinned_out ? kFartherAtFolds : kFartherBetween * turn,
                     nearly = std::max(kNearlyAtFolds * tolerance_, tolerance_ - farther * spacing);
        Box box;
        for (const int v : triangles[t]) box.extend(vertices[v]);
        crossings_.for_each_in(Box(box.min() - reach, box.max() + reach), [&](std::size_t c) {
            if (at_crossings[c] > nearly) at_fold[c].store(1, std::memory_order_relaxed);
        });
    });
    looked_at_.resize(crossings_.size(), 0);
    const double nearly = std::max(kNearlyTooFar * tolerance_, tolerance_ - kFarther * spacing);
    constexpr std::size_t kBlock = 32768;
    const auto doubtful = find_in_blocks<int>(
        crossings_.size(), kBlock, [&](std::size_t begin, std::size_t end, std::vector<int>& found) {
            for (std::size_t c = begin; c < end; ++c) {
                const double d = at_crossings[c];
                if (looked_at_[c] || d > kCertified * tolerance_) continue;
                if (!(d > nearly || (at_fold[c] && !crossings_[c].flat))) continue;
                looked_at_[c] = 1;
                found.push_back(static_cast<int>(c));
            }
        });
    if (!thinned_out) return cells_.around(doubtful);
    std::vector<Surface::Crossing> result;
    for (const bool flat : {false, true}) {
        std::vector<Vec3> places;
        for (const int c : doubtful)
            if (const Surface::Crossing crossing = crossings_[c]; crossing.flat == flat)
                places.push_back(crossing.point);
        const double within = flat ? kStandsForOnFlat : kStandsForWithin;
        const auto near = surface_.crossings_near(places, within * crossings_.spacing());
        result.insert(result.end(), near.begin(), near.end());
    }
    return result;
}

}  // namespace isotrack
