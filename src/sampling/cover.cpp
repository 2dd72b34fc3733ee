#include "isotrack/sampling/cover.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

namespace isotrack {
namespace {

constexpr double kSeedDistance = 0.7;  // of the spacing: what a seed covers
constexpr double kReach = 1.2;         // of the spacing: what a particle that is already there covers
constexpr double kOffPlane =
    0.5;  // of the reach: how far from a particle's tangent plane surface counts as its own
// A lattice edge along the surface, up to this cosine, counts to either side where it crosses at the particle
// itself.
constexpr double kGrazing = 0.01, kHere = 0.1;  // kHere: resolutions
constexpr double kLargestSeed =
    5.0;  // resolutions: a first spacing above this would step over small features

/// Crossings in cells of a regular grid, sorted by cell, so that those within a distance of a point can be
/// visited.
class CrossingGrid {
public:
    CrossingGrid(const std::vector<Surface::Crossing>& crossings, double cell_size)
        : crossings_(crossings), cell_size_(cell_size) {
        Box box;
        for (const auto& c : crossings) box.extend(c.point);
        origin_ = box.min();
        for (int axis = 0; axis < 3; ++axis)
            size_[axis] = static_cast<std::int64_t>(box.sizes()[axis] / cell_size) + 1;
        keyed_.reserve(crossings.size());
        for (std::size_t i = 0; i < crossings.size(); ++i)
            keyed_.push_back({key(cell(crossings[i].point)), static_cast<int>(i)});
        std::sort(keyed_.begin(), keyed_.end());
    }

    template <typename Visit>
    void for_each_within(const Vec3& p, double radius, const Visit& visit) const {
        const auto low = cell(p - Vec3::Constant(radius)), high = cell(p + Vec3::Constant(radius));
        for (std::int64_t x = std::max<std::int64_t>(low[0], 0); x <= std::min(high[0], size_[0] - 1); ++x)
            for (std::int64_t y = std::max<std::int64_t>(low[1], 0); y <= std::min(high[1], size_[1] - 1);
                 ++y) {
                const std::int64_t from = std::max<std::int64_t>(low[2], 0),
                                   to = std::min(high[2], size_[2] - 1);
                if (from > to) continue;
                auto it = std::lower_bound(keyed_.begin(), keyed_.end(), Entry{key({x, y, from}), -1});
                for (; it != keyed_.end() && it->key <= key({x, y, to}); ++it)
                    if ((crossings_[it->crossing].point - p).squaredNorm() <= radius * radius)
                        visit(it->crossing);
            }
    }

private:
    using Cell = std::array<std::int64_t, 3>;
    struct Entry {
        std::int64_t key;
        int crossing;
        bool operator<(const Entry& o) const { return key != o.key ? key < o.key : crossing < o.crossing; }
    };
    Cell cell(const Vec3& p) const {
        Cell c;
        for (int axis = 0; axis < 3; ++axis)
            c[axis] = static_cast<std::int64_t>(std::floor((p[axis] - origin_[axis]) / cell_size_));
        return c;
    }
    std::int64_t key(const Cell& c) const { return (c[0] * size_[1] + c[1]) * size_[2] + c[2]; }

    const std::vector<Surface::Crossing>& crossings_;
    double cell_size_;
    Vec3 origin_ = Vec3::Zero();
    Cell size_{};
    std::vector<Entry> keyed_;
};

/// A shuffled order that depends on the seed and the count alone [splitmix64].
std::uint64_t mix(std::uint64_t x) {
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

}  // namespace

std::size_t cover(Particles& particles, const Surface& surface, const SizingLimits& limits,
                  std::uint64_t seed, Id& next_id) {
    const std::vector<Surface::Crossing> crossings = surface.crossings();
    if (crossings.empty()) return 0;
    const double resolution = surface.resolution();
    const CrossingGrid grid(crossings, 2.0 * resolution);
    std::vector<char> covered(crossings.size(), 0);
    const auto mark = [&](const Vec3& p, const Vec3& n, double reach) {
        reach =
            std::max(reach, 1.2 * resolution);  // a crossing lies within a cell's diagonal of its neighbours
        const double off_plane = std::max(kOffPlane * reach, 0.5 * resolution);
        grid.for_each_within(p, reach, [&](int c) {
            if (covered[c]) return;
            const Vec3 way = crossings[c].point - p;
            const double facing = n.dot(crossings[c].outward.cast<double>());
            const bool same_side = facing > 0.0 || (facing > -kGrazing && way.norm() < kHere * resolution);
            if (same_side && std::abs(n.dot(way)) < off_plane) covered[c] = 1;
        });
    };
    for (std::size_t i = 0; i < particles.size(); ++i)
        mark(particles.position[i], particles.normal[i], kReach * particles.spacing[i]);

    std::vector<int> order;
    for (std::size_t c = 0; c < crossings.size(); ++c)
        if (!covered[c]) order.push_back(static_cast<int>(c));
    std::sort(order.begin(), order.end(), [&](int a, int b) {
        const auto ka = mix(seed ^ mix(a)), kb = mix(seed ^ mix(b));
        return ka != kb ? ka < kb : a < b;
    });
    const auto probe = surface.probe();
    std::size_t added = 0;
    for (const int c : order) {
        if (covered[c]) continue;
        covered[c] = 1;
        const auto p = probe->project(crossings[c].point);
        if (!p || (*p - crossings[c].point).norm() > 1.5 * resolution) continue;
        const Vec3 n = probe->normal(*p);
        if (!(n.squaredNorm() > 0.0)) continue;
        const double h = std::min(spacing_from_curvature(*probe, *p, n, resolution, limits),
                                  std::max(kLargestSeed * resolution, limits.min_edge));
        particles.add(*p, n, h, next_id++);
        mark(*p, n, kSeedDistance * h);
        ++added;
    }
    return added;
}

}  // namespace isotrack
