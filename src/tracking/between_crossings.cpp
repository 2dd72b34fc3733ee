#include "tracking/between_crossings.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <iterator>

#include "atomic_extremes.h"
#include "find_in_blocks.h"
#include "meshing/triangle_box.h"
#include "meshing/triangle_distance.h"
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
constexpr double kNearFold =
    2.0;  // spacings: a fold farther off is not between it and what lies in its cells
// Spacings: so far around lie those that a crossing stands for.
constexpr double kStandsForWithin = 0.5, kStandsForOnFlat = 2.0;
constexpr double kFold = 0.9;  // cosine between a triangle's normal and that of a corner

constexpr std::size_t kGrain = 1024, kBlock = 32768;

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
    std::vector<std::atomic<float>> turn(vertices.size());  // raised by several threads
    parallel_for_each(triangles.size(), kGrain, [&](std::size_t t) {
        for (const int v : triangles[t]) {
            const float dot = area[t].dot(sum[v]), norms = area[t].norm() * sum[v].norm();
            if (dot >= kFold * norms) continue;
            raise_to(turn[v], dot > 0.0f ? std::sqrt(1.0f - dot / norms * (dot / norms)) : 1.0f);
        }
    });
    return {turn.begin(), turn.end()};
}

/// The folds at a triangle: along an edge where both ends turn; where one alone does, at that end.
struct Folds {
    std::array<Vec3, 3> corner;
    std::array<double, 3> turn;  // at each

    /// The sharpest of those within a distance of a place, which is given squared; 0: none.
    double turn_near(const Vec3& p, double near2) const {
        double result = 0.0;
        for (int k = 0; k < 3; ++k) {
            const int next = (k + 1) % 3;
            const double sharper = std::max(turn[k], turn[next]);
            if (!(sharper > result)) continue;
            const Vec3 &from = corner[turn[k] > 0.0 ? k : next], &to = corner[turn[next] > 0.0 ? next : k];
            if (squared_distance(p, from, to) < near2) result = sharper;
        }
        return result;
    }
};

Box box_along(const Triangle& t, const std::vector<Vec3>& vertices, double distance) {
    const Box box = box_of(vertices, t);
    const Vec3 reach = Vec3::Constant(distance);
    return Box(box.min() - reach, box.max() + reach);
}

bool has_any(const Triangle& t, const std::vector<char>& flagged) {
    return flagged[t[0]] || flagged[t[1]] || flagged[t[2]];
}

/// Flags for the vertices that are at some places, which floats hold.
std::vector<char> flags_at(const std::vector<Eigen::Vector3f>& places, const std::vector<Vec3>& vertices) {
    using Place = std::array<float, 3>;
    const auto as_array = [](const Eigen::Vector3f& p) { return Place{p.x(), p.y(), p.z()}; };
    std::vector<Place> sorted;
    sorted.reserve(places.size());
    for (const Eigen::Vector3f& p : places) sorted.push_back(as_array(p));
    std::sort(sorted.begin(), sorted.end());
    sorted.erase(std::unique(sorted.begin(), sorted.end()), sorted.end());
    std::vector<char> result(vertices.size());
    parallel_for_each(vertices.size(), kGrain, [&](std::size_t v) {
        result[v] = std::binary_search(sorted.begin(), sorted.end(), as_array(vertices[v].cast<float>()));
    });
    return result;
}

}  // namespace

void BetweenCrossings::flag_at_folds(const std::vector<Triangle>& triangles, const std::vector<float>& turns,
                                     const std::vector<Vec3>& vertices, const MeshDistances& at_crossings,
                                     Flags& at_fold) const {
    const double spacing = crossings_.spacing(), near2 = kNearFold * spacing * kNearFold * spacing;
    const bool thinned_out = crossings_.thinned_out(surface_);
    parallel_for_each(triangles.size(), kGrain, [&](std::size_t t) {
        const auto& [i, j, k] = triangles[t];
        const Folds folds{{vertices[i], vertices[j], vertices[k]}, {turns[i], turns[j], turns[k]}};
        const double sharpest = *std::max_element(folds.turn.begin(), folds.turn.end());
        if (sharpest == 0.0) return;
        const auto is_nearly_too_far = [&](std::size_t c, double turn) {
            const double farther = thinned_out ? kFartherAtFolds : kFartherBetween * turn;
            return at_crossings[c] > std::max(kNearlyAtFolds * tolerance_, tolerance_ - farther * spacing);
        };
        crossings_.for_each_in(box_along(triangles[t], vertices, tolerance_), [&](std::size_t c) {
            if (at_fold[c].load(std::memory_order_relaxed) || !is_nearly_too_far(c, sharpest)) return;
            if (thinned_out || is_nearly_too_far(c, folds.turn_near(crossings_[c].point, near2)))
                at_fold[c].store(1, std::memory_order_relaxed);
        });
    });
}

bool BetweenCrossings::take_doubtful(std::size_t crossing, const MeshDistances& at_crossings,
                                     const Flags& at_fold) {
    const double nearly = std::max(kNearlyTooFar * tolerance_, tolerance_ - kFarther * crossings_.spacing());
    const double d = at_crossings[crossing];
    if (looked_at_[crossing] || d > kCertified * tolerance_) return false;
    if (!(d > nearly || (at_fold[crossing] && !crossings_[crossing].flat))) return false;
    looked_at_[crossing] = 1;
    return true;
}

PackedCrossings BetweenCrossings::points_beside(const std::vector<int>& doubtful) {
    if (!crossings_.thinned_out(surface_)) return cells_.around(doubtful);
    PackedCrossings result(surface_.bounds().min(), surface_.lattice());
    for (const bool flat : {false, true}) {
        std::vector<Vec3> places;
        for (const int c : doubtful)
            if (const Surface::Crossing crossing = crossings_[c]; crossing.flat == flat)
                places.push_back(crossing.point);
        const double within = flat ? kStandsForOnFlat : kStandsForWithin;
        const auto near = surface_.crossings_near(places, within * crossings_.spacing());
        result.entries.reserve(result.size() + near.size());
        // Where details are smaller than the tolerance there may be no triangle for a long way that faces as
        // they do, and one that does stands for the crossing they are beside.
        for (const Surface::Crossing& crossing : near)
            result.entries.push_back(result.packed(crossing.point, PackedCrossings::kNoWay));
    }
    return result;
}

PackedCrossings BetweenCrossings::points(const std::vector<Vec3>& vertices,
                                         const std::vector<Triangle>& triangles,
                                         const MeshDistances& at_crossings) {
    Flags at_fold(crossings_.size());
    flag_at_folds(triangles, turns_at_vertices(vertices, triangles), vertices, at_crossings, at_fold);
    looked_at_.resize(crossings_.size(), 0);
    return points_beside(find_in_blocks<int>(
        crossings_.size(), kBlock, [&](std::size_t begin, std::size_t end, std::vector<int>& found) {
            for (std::size_t c = begin; c < end; ++c)
                if (take_doubtful(c, at_crossings, at_fold)) found.push_back(static_cast<int>(c));
        }));
}

PackedCrossings BetweenCrossings::points_near(const Changes& changes, const std::vector<Vec3>& vertices,
                                              const std::vector<Triangle>& triangles,
                                              const MeshDistances& at_crossings) {
    // Crossings whose distances changed are looked at; and since normals turned at the corners of what came,
    // those along the triangles there, which may be at a fold now.
    std::vector<int> near;
    {
        Flags is_near(crossings_.size());
        const auto flag = [&](std::size_t c) { is_near[c].store(1, std::memory_order_relaxed); };
        for (const int c : changes.crossings) flag(c);
        const std::vector<char> turned = flags_at(changes.corners, vertices);
        parallel_for_each(triangles.size(), kGrain, [&](std::size_t t) {
            if (has_any(triangles[t], turned))
                crossings_.for_each_in(box_along(triangles[t], vertices, tolerance_), flag);
        });
        near = find_in_blocks<int>(crossings_.size(), kBlock,
                                   [&](std::size_t begin, std::size_t end, std::vector<int>& found) {
                                       for (std::size_t c = begin; c < end; ++c)
                                           if (is_near[c]) found.push_back(static_cast<int>(c));
                                   });
    }
    const CrossingGrid near_alone = crossings_.some(near);
    std::vector<char> beside(triangles.size(), 0), at(vertices.size(), 0);
    parallel_for_each(triangles.size(), kGrain, [&](std::size_t t) {
        near_alone.for_each_in(box_along(triangles[t], vertices, tolerance_),
                               [&](std::size_t) { beside[t] = 1; });
    });
    std::vector<Triangle> some;
    for (std::size_t t = 0; t < triangles.size(); ++t) {
        if (!beside[t]) continue;
        some.push_back(triangles[t]);
        for (const int v : triangles[t]) at[v] = 1;
    }
    const auto around = find_in_blocks<Triangle>(
        triangles.size(), 4 * kGrain, [&](std::size_t begin, std::size_t end, std::vector<Triangle>& found) {
            std::copy_if(triangles.begin() + static_cast<std::ptrdiff_t>(begin),
                         triangles.begin() + static_cast<std::ptrdiff_t>(end), std::back_inserter(found),
                         [&](const Triangle& t) { return has_any(t, at); });
        });
    Flags at_fold(crossings_.size());
    flag_at_folds(some, turns_at_vertices(vertices, around), vertices, at_crossings, at_fold);
    std::vector<int> doubtful;
    for (const int c : near)
        if (take_doubtful(c, at_crossings, at_fold)) doubtful.push_back(c);
    return points_beside(doubtful);
}

}  // namespace isotrack
