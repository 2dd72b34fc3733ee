#include "sampling/creases.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "parallel_for_each.h"
#include "surface/thread_probes.h"
#include "ways_around.h"

namespace isotrack {
namespace {

constexpr double kTurn = 0.94;                  // cosine between neighbours' normals: less may be a crease
constexpr double kNeighbourly = 2.0;            // spacings
constexpr double kReach = 0.4;                  // of the spacing
constexpr double kRoom = 0.8;                   // of the spacing: nobody that near to where it goes
constexpr double kRoomBack = 0.3;               // likewise, for who comes back
constexpr double kStill = 0.02;                 // of the spacing: one that moves less is there already
constexpr double kSlid = 0.1, kStayed = 0.002;  // of the spacing: how far somebody has slid off a crease
constexpr double kLine = 0.03;       // second eigenvalue: a crease of 20 degrees through the middle
constexpr double kSharpLine = 0.12;  // likewise, of 45 degrees
constexpr double kCorner = 0.15;     // third: that of a cube has 0.2, a ball of two resolutions less than 0.1
// Of what all ways turn by at a crease: beyond one that is half as far off as they are, or less, is every
// third of them, and one at least of every second.
constexpr double kOfHalf = 0.25;

bool may_be_near_crease(const Particles& particles, Adjacency::Range neighbours, int i) {
    const double near = kNeighbourly * particles.spacing[i];
    return std::any_of(neighbours.begin(), neighbours.end(), [&](int j) {
        return particles.normal[i].dot(particles.normal[j]) < kTurn &&
               (particles.position[j] - particles.position[i]).squaredNorm() < near * near;
    });
}

bool is_taken(const Particles& particles, Adjacency::Range neighbours, const Vec3& place, const Vec3& normal,
              double distance) {
    return std::any_of(neighbours.begin(), neighbours.end(), [&](int j) {
        return particles.normal[j].dot(normal) > 0.0 &&
               (particles.position[j] - place).squaredNorm() < distance * distance;
    });
}

/// A place on a crease or in a corner.
struct Place {
    Vec3 position, normal;
    Crease crease;
};

struct Search {
    double reach, around;  // of places, and how far off the planes are that tell them; world units
    double least_line;     // the second eigenvalue of a crease
    double of_half;        // share of the least turn that half of the ways must have for more to be looked at
};

/// A place near particle i, if there is one.
std::optional<Place> place_near(const Particles& particles, Adjacency::Range neighbours, int i,
                                const Search& search, Surface::Probe& probe) {
    const auto& [reach, around, least_line, of_half] = search;
    if (!may_be_near_crease(particles, neighbours, i)) return std::nullopt;
    const Vec3 p = particles.position[i], n = particles.normal[i];
    const Vec3 a = n.unitOrthogonal(), b = n.cross(a);
    Mat3 normals = n * n.transpose();  // of the normal equations, for moves from p, as is the pull
    Vec3 pull = Vec3::Zero();
    double turned = 0.0;  // squared sines, whose mean no second eigenvalue is above
    const std::size_t half = ways_around().size() / 2;
    const double planes = static_cast<double>(ways_around().size() + 1), wanted = planes * least_line;
    for (std::size_t k = 0; k < 2 * half; ++k) {
        if (k == half && turned < of_half * wanted) return std::nullopt;
        // Every second way first, then those between, where the first may do.
        const std::size_t way = of_half == 0.0 ? k : k < half ? 2 * k : 2 * (k - half) + 1;
        const auto& [cosine, sine] = ways_around()[way];
        const Vec3 to = around * (cosine * a + sine * b);
        const Surface::Sample f = probe.sample(p + to);
        const double slope = f.gradient.norm();
        if (!(slope > 0.0)) return std::nullopt;
        const Vec3 m = f.gradient / slope;
        normals += m * m.transpose();
        pull += (m.dot(to) - f.value / slope) * m;
        turned += 1.0 - m.dot(n) * m.dot(n);
    }
    if (!(turned > wanted)) return std::nullopt;
    const Eigen::SelfAdjointEigenSolver<Mat3> spread(normals / planes);
    const Vec3& values = spread.eigenvalues();  // ascending
    if (!(values[1] > least_line)) return std::nullopt;
    const bool is_corner = values[0] > kCorner;
    Vec3 move = Vec3::Zero();
    for (int k = is_corner ? 0 : 1; k < 3; ++k) {
        const Vec3 axis = spread.eigenvectors().col(k);
        move += axis.dot(pull) / (planes * values[k]) * axis;
    }
    const auto is_within = [&](const Vec3& x) { return x.squaredNorm() < reach * reach; };
    if (!is_within(move)) return std::nullopt;
    const auto q = probe.project(p + move);
    if (!q || !is_within(*q - p)) return std::nullopt;
    const Vec3 normal = probe.normal(*q);
    if (!(normal.dot(n) > 0.0)) return std::nullopt;
    return Place{
        *q, normal, {is_corner ? Crease::Kind::Corner : Crease::Kind::Line, spread.eigenvectors().col(0)}};
}

}  // namespace

Crease pull_to_crease(Particles& particles, Adjacency::Range neighbours, int i, double resolution,
                      Surface::Probe& probe) {
    const double h = particles.spacing[i];
    const auto place = place_near(particles, neighbours, i,
                                  {kReach * h, std::max(kReach * h, resolution), kLine, 0.0}, probe);
    if (!place) return {};
    const bool stays = (place->position - particles.position[i]).norm() < kStill * h;
    if (!stays && is_taken(particles, neighbours, place->position, place->normal, kRoom * h)) return {};
    particles.position[i] = place->position;
    particles.normal[i] = place->normal;
    return place->crease;
}

void return_to_creases(Particles& particles, const Adjacency& adjacency, const Surface& surface) {
    ThreadProbes probes(surface);
    std::vector<std::optional<Place>> places(particles.size());
    parallel_for_each(particles.size(), 64, [&](std::size_t i) {
        const double h = particles.spacing[i], around = std::max(2.0 * kSlid * h, surface.resolution());
        places[i] = place_near(particles, adjacency.of(i), static_cast<int>(i),
                               {kSlid * h, around, kSharpLine, kOfHalf}, probes.local());
    });
    for (std::size_t i = 0; i < particles.size(); ++i) {
        if (!places[i]) continue;
        const auto& [position, normal, crease] = *places[i];
        const double h = particles.spacing[i];
        const Vec3 way = position - particles.position[i];
        if (way.norm() < kStayed * h || is_taken(particles, adjacency.of(i), position, normal, kRoomBack * h))
            continue;
        particles.position[i] = position;
        particles.normal[i] = normal;
    }
}

}  // namespace isotrack
