#include "tracking/inspection.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <utility>

#include "find_in_blocks.h"
#include "parallel_for_each.h"
#include "sampling/compact.h"
#include "surface/lattice_scan.h"
#include "surface/surface_near.h"
#include "surface/thread_probes.h"
#include "tracking/failing.h"

namespace isotrack {
namespace {

constexpr double kLostAt = 3.0;  // tolerances
constexpr double kMany = 0.3;    // of the triangles: when more change all distances are measured again
constexpr double kAroundChanges = 2.01;                    // cutoffs: and some room for rounding
constexpr double kFaultReach = 1.5;                        // resolutions
constexpr double kMissedSpacing = 0.75, kMissedAt = 1.3;   // resolutions, tolerances: no particle is nearer
constexpr double kFaultSpacing = 0.8, kVainSpacing = 0.4;  // resolutions
// Resolutions: denser than that nothing near a fault was mended; or not much, where very many are.
constexpr double kLeastDoubtful = 0.01, kLeastWhereMany = 0.25;
constexpr std::size_t kManyDoubtful = 64;

/// Around so many doubtful places.
double least_spacing(std::size_t places, const Surface& surface) {
    return (places > kManyDoubtful ? kLeastWhereMany : kLeastDoubtful) * surface.resolution();
}

struct Corners {
    Triangle particle;
    bool whole;  // no midpoint among them
};

Corners corners_of(const CarvedSurface& carved, std::size_t triangle) {
    Corners result{{}, true};
    for (int k = 0; k < 3; ++k) {
        result.particle[k] = carved.particle[carved.triangles[triangle][k]];
        result.whole = result.whole && result.particle[k] >= 0;
    }
    return result;
}

/// For a triangle that is too sharp across a crease or a rim: the middle between the particles of its longest
/// edge. Where that edge lies along the crease neither the other diagonal nor moving corners would do. None
/// for one less than a detail high.
std::optional<Shortage> crease_shortage(const FrameMesh& mesh, const Particles& particles,
                                        std::size_t triangle, const Triangle& corner, double detail) {
    constexpr double kLeastHeight = 1.0;  // details: what is thinner has needles anyway
    constexpr double kSpacing = 0.2;      // of the longest edge
    const Triangle& t = mesh.carved.triangles[triangle];
    const auto edge = [&](int k) -> Vec3 {
        return mesh.vertices[t[(k + 2) % 3]] - mesh.vertices[t[(k + 1) % 3]];
    };
    int k = 0;
    for (int i = 1; i < 3; ++i)
        if (edge(i).squaredNorm() > edge(k).squaredNorm()) k = i;
    const double longest = edge(k).norm();
    if (edge(0).cross(edge(1)).norm() < kLeastHeight * detail * longest) return std::nullopt;
    const auto& at = particles.position;
    return Shortage{0.5 * (at[corner[(k + 1) % 3]] + at[corner[(k + 2) % 3]]), kSpacing * longest};
}

/// Ascending.
std::vector<Vec3> crossings_around(const std::vector<Vec3>& places, const Surface& surface) {
    const Eigen::Affine3d lattice = surface.lattice(), to_lattice = lattice.inverse();
    const double reach = kFaultReach * surface.resolution();
    const Vec3 extent = reach * to_lattice.linear().rowwise().norm();
    constexpr std::size_t kPlacesPerBlock = 32;
    auto found = find_in_blocks<std::array<double, 3>>(
        places.size(), kPlacesPerBlock,
        [&](std::size_t begin, std::size_t end, std::vector<std::array<double, 3>>& near) {
            const auto probe = surface.probe();
            for (std::size_t i = begin; i < end; ++i) {
                const Vec3 middle = to_lattice * places[i];
                const Vec3 from = (middle - extent).array().floor(), to = (middle + extent).array().ceil();
                const Eigen::Array3i size = (to - from).cast<int>().array() + 1;
                scan_lattice(*probe, lattice, from, size,
                             [&](const Vec3& node, int axis, double fraction, bool) {
                                 const Vec3 p = lattice * (node + fraction * Vec3::Unit(axis));
                                 if ((p - places[i]).norm() <= reach) near.push_back({p.x(), p.y(), p.z()});
                             });
            }
        });
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    std::vector<Vec3> result;
    for (const auto& [x, y, z] : found) result.emplace_back(x, y, z);
    return result;
}

}  // namespace

Inspector::Inspector(const Surface& surface, const SizingLimits& limits, const CrossingGrid& crossings)
    : surface_(surface), limits_(limits), crossings_(crossings) {
    distances_.emplace_back(crossings_, cutoff());
    missed_.emplace_back();
}

double Inspector::cutoff() const {
    return kLostAt * limits_.tolerance;
}

void Inspector::restart() {
    expected_.reset();
    facets_ = {};
    errors_.reset();
    forget_distances();
    looked_at_topology_ = false;
}

std::function<void()> Inspector::expect(const std::vector<Vec3>& particles,
                                        const std::vector<Triangle>& triangles) {
    expected_.emplace().errors.resize(triangles.size());
    return [this, &particles, &triangles] {
        expected_->triangles = {particles.size(), triangles};
        measure_into(expected_->errors, particles, expected_->triangles.triangles());
    };
}

std::vector<FacetError> Inspector::errors_of(const std::vector<Vec3>& vertices,
                                             const std::vector<Triangle>& triangles) const {
    std::vector<FacetError> errors;
    measure_into(errors, vertices, triangles);
    return errors;
}

void Inspector::measure_into(std::vector<FacetError>& errors, const std::vector<Vec3>& vertices,
                             const std::vector<Triangle>& triangles) const {
    errors.resize(triangles.size());
    certify_each(vertices, triangles, surface_, limits_.detail, kSuspect * limits_.tolerance,
                 [&](std::size_t t, const TriangleError& error) { errors[t] = error; });
}

std::vector<FacetError> Inspector::errors_of(const std::vector<Vec3>& corners) const {
    std::vector<Triangle> triangles;
    for (int c = 0; c < static_cast<int>(corners.size()); c += 3) triangles.push_back({c, c + 1, c + 2});
    return errors_of(corners, triangles);
}

std::vector<Vec3> Inspector::measure_errors(const FrameMesh& mesh, Inspection& result,
                                            FacetChanges& changes) {
    constexpr std::size_t kSame = ~std::size_t{0}, kGrain = 1024;
    const MeshFacets facets(mesh.carved, mesh.vertices);
    std::vector<const FacetError*> known(facets.size(), nullptr);
    std::vector<char> seen(facets.size(), 0);  // in the mesh before
    // Where all triangles keep their numbers, as when a mesh is made blunter, and nobody else holds the
    // errors before, these go to their places: another thread's heap need not grow for them.
    std::atomic<bool> in_place = errors_.use_count() == 1 && errors_->size() == facets.size();
    const auto take_same = [&](std::size_t f, std::size_t old) {
        known[f] = &(*errors_)[old];
        seen[f] = 1;
        if (f != old && in_place) in_place = false;
    };
    struct Unkeyed {
        std::vector<std::size_t> number;
        std::vector<Facet> facet;
    };
    const FacetDifference differ = compare(facets, facets_, take_same);
    const auto unkeyed_of = [&](const std::vector<std::size_t>& numbers, const auto& all,
                                std::vector<Facet>& changed) {
        Unkeyed unkeyed;
        for (const std::size_t n : numbers) {
            const Facet facet = all[n];
            if (facet.key < 0) {
                unkeyed.number.push_back(n);
                unkeyed.facet.push_back(facet);
            } else if (measured_) {
                changed.push_back(facet);
            }
        }
        return unkeyed;
    };
    Unkeyed came = unkeyed_of(differ.came, facets, changes.came),
            went = unkeyed_of(differ.went, facets_, changes.went);
    for (const auto& [c, w] : same_corners(came.facet, went.facet)) {
        take_same(came.number[c], went.number[w]);
        came.number[c] = went.number[w] = kSame;
    }
    const auto take_changed = [&](const Unkeyed& some, std::vector<Facet>& changed) {
        for (std::size_t i = 0; measured_ && i < some.number.size(); ++i)
            if (some.number[i] != kSame) changed.push_back(some.facet[i]);
    };
    take_changed(came, changes.came);
    take_changed(went, changes.went);
    if (!in_place) facets_ = {};  // of no more use
    changes.many = static_cast<double>(std::max(changes.came.size(), changes.went.size())) >
                   kMany * static_cast<double>(facets.size());
    if (expected_)
        parallel_for_each(facets.size(), kGrain, [&](std::size_t f) {
            if (known[f]) return;
            const auto [corner, whole] = corners_of(mesh.carved, f);
            const int e = whole ? expected_->triangles.find(corner) : -1;
            if (e >= 0) known[f] = &expected_->errors[e];
        });
    std::vector<Triangle> fresh;
    for (std::size_t f = 0; f < facets.size(); ++f)
        if (!known[f]) fresh.push_back(from_least_corner(mesh.carved.triangles[f]));
    const auto errors = errors_of(mesh.vertices, fresh);
    auto next = errors.begin();
    for (const FacetError*& error : known)
        if (!error) error = &*next++;
    const auto measured = in_place ? errors_ : std::make_shared<std::vector<FacetError>>(facets.size());
    std::vector<char> too_far(facets.size());
    parallel_for_each(facets.size(), kGrain, [&](std::size_t f) {
        (*measured)[f] = *known[f];
        too_far[f] = is_too_far(*known[f], limits_.tolerance);
    });
    std::vector<Vec3> in_vain;
    const auto probe = surface_.probe();
    for (std::size_t f = 0; f < facets.size(); ++f) {
        if (!too_far[f]) continue;
        const Vec3 where = (*measured)[f].where.cast<double>();
        if (seen[f] || !probe->project(where)) in_vain.push_back(where);
    }
    result.errors = errors_ = measured;  // first: the errors before have no use any more
    expected_.reset();                   // vertices may move from now on
    facets_.assign(mesh.carved, mesh.vertices);
    return in_vain;
}

void Inspector::take_missed(std::size_t d, Inspection& result) {
    const auto survey = distances_[d].survey(kCertified * limits_.tolerance);
    result.lost_crossings += survey.lost;
    result.farthest_crossing = std::max(result.farthest_crossing, survey.farthest);
    const std::vector<int> before = std::exchange(missed_[d], survey.beyond);
    std::vector<Vec3> in_vain;
    for (const int i : survey.beyond) {
        const Surface::Crossing place = distances_[d].points()[i];
        result.missed.push_back(place);
        if (std::binary_search(before.begin(), before.end(), i)) in_vain.push_back(place.point);
    }
    doubt(in_vain, kVainSpacing, result);
    if (d > 0) {  // they are not among the crossings around them
        std::vector<Shortage> at;
        for (const int i : survey.beyond)
            at.push_back({distances_[d].points()[i].point, kVainSpacing * surface_.resolution(),
                          least_spacing(survey.beyond.size(), surface_)});
        result.doubts.push_back({{}, 0.0, std::move(at)});
    } else if (survey.weight > 0.0) {
        result.crossings_mean_square = survey.sum_of_squares / survey.weight;
    }
}

Inspection Inspector::inspect(const FrameMesh& mesh) {
    Inspection result;
    forget_distances();
    FacetChanges changes;
    doubt(measure_errors(mesh, result, changes), kVainSpacing, result);
    return result;
}

Inspection Inspector::inspect_both_ways(const FrameMesh& mesh) {
    Inspection result;
    FacetChanges changes;
    doubt(measure_errors(mesh, result, changes), kVainSpacing, result);
    measured_ = true;
    if (since_look_) {
        since_look_->triangles += changes.came.size() + changes.went.size();
        auto& corners = since_look_->corners;
        for (const Facet& facet : changes.came)
            corners.insert(corners.end(), facet.corner.begin(), facet.corner.end());
    }
    if (!changes.many)
        changes.around = triangles_near_gone(changes.went, kAroundChanges * cutoff(), mesh.vertices,
                                             mesh.carved.triangles);
    for (std::size_t d = 0; d < distances_.size(); ++d) {
        const auto changed = distances_[d].measure(mesh.vertices, mesh.carved.triangles, changes);
        if (d == 0 && !changed) since_look_.reset();
        if (d == 0 && since_look_)
            since_look_->crossings.insert(since_look_->crossings.end(), changed->begin(), changed->end());
        take_missed(d, result);
    }
    return result;
}

void Inspector::set_unreachable_aside(PackedCrossings& points) {
    constexpr double kNear = 0.1, kReachable = 0.95;  // tolerances off the surface
    ThreadProbes probes(surface_);
    std::vector<char> keep(points.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, points.size(), 64), [&](const auto& range) {
        Surface::Probe& probe = probes.local();
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            const Vec3 p = points.point(i);
            keep[i] = std::abs(probe.value(p)) < kNear * limits_.tolerance;
            if (keep[i]) continue;
            keep[i] = surface_near(probe, p, kReachable * limits_.tolerance).has_value();
        }
    });
    for (std::size_t i = 0; i < points.size(); ++i)
        if (!keep[i]) unreachable_.push_back(points[i]);
    compact(points.entries, keep);
}

void Inspector::measure_between(Surface::CrossingSequence points, const FrameMesh& mesh,
                                Inspection& inspection) {
    if (points.size == 0) return;
    between_.emplace_back(std::move(points), surface_.resolution());
    distances_.emplace_back(between_.back(), cutoff()).measure(mesh.vertices, mesh.carved.triangles, {});
    missed_.emplace_back();
    take_missed(missed_.size() - 1, inspection);
}

void Inspector::look_between(const FrameMesh& mesh, Inspection& inspection) {
    if (!between_crossings_) {
        std::vector<Surface::Diagonal> diagonals;
        if (!thins_out()) diagonals = sides_ ? sides_->diagonals() : surface_.diagonals();
        between_crossings_.emplace(surface_, crossings_, diagonals, limits_.tolerance);
    }
    const bool all = !since_look_ || static_cast<double>(since_look_->triangles) >
                                         kMany * static_cast<double>(mesh.carved.triangles.size());
    auto points = all ? between_crossings_->points(mesh.vertices, mesh.carved.triangles, distances_.front())
                      : between_crossings_->points_near(*since_look_, mesh.vertices, mesh.carved.triangles,
                                                        distances_.front());
    since_look_.emplace();
    if (!thins_out()) set_unreachable_aside(points);
    measure_between(Surface::CrossingSequence(std::move(points)), mesh, inspection);
}

void Inspector::look_off_surface(const FrameMesh& mesh, Inspection& inspection) {
    measure_between(Surface::CrossingSequence(std::exchange(unreachable_, {})), mesh, inspection);
}

std::vector<Surface::Crossing> Inspector::newly_missed(const Inspection& now,
                                                       const std::vector<Vec3>& vertices,
                                                       const std::vector<Triangle>& triangles) const {
    std::vector<Surface::Crossing> result;
    if (now.missed.empty()) return result;
    const CrossingGrid grid(now.missed, limits_.tolerance);
    const auto distances = crossing_distances(vertices, triangles, grid, kCertified * limits_.tolerance);
    for (std::size_t c = 0; c < grid.size(); ++c)
        if (std::isfinite(distances[c])) result.push_back(grid[c]);
    return result;
}

std::vector<const CrossingGrid*> Inspector::reached() const {
    std::vector<const CrossingGrid*> result(1, &crossings_);
    for (const CrossingGrid& points : between_) result.push_back(&points);
    return result;
}

void Inspector::forget_distances() {
    for (MeshDistances& distances : distances_) distances.forget();
    measured_ = false;
    since_look_.reset();
    for (std::vector<int>& missed : missed_) missed.clear();
}

void Inspector::doubt(const std::vector<Vec3>& places, double spacing, Inspection& inspection) const {
    if (!places.empty()) inspection.doubts.push_back({places, spacing * surface_.resolution(), {}});
}

void Inspector::prepare_topology() {
    if (!sides_) sides_.emplace(surface_);
}

std::optional<std::size_t> Inspector::lattice_component_count() {
    if (!component_count_) component_count_ = surface_.lattice_component_count();
    return *component_count_;
}

const std::optional<std::vector<Box>>& Inspector::lattice_components() {
    if (!components_) components_ = surface_.lattice_components();
    return *components_;
}

void Inspector::inspect_topology(const FrameMesh& mesh, Inspection& inspection) {
    prepare_topology();
    inspection.topology = lattice_topology(mesh.vertices, mesh.carved.triangles, *sides_);
    if (std::exchange(looked_at_topology_, true)) return;
    doubt(inspection.topology.faults, kFaultSpacing, inspection);
    std::vector<Vec3> places;
    for (std::size_t t = 0; t < inspection.topology.speck.size(); ++t) {
        const auto& [i, j, k] = mesh.carved.triangles[t];
        if (inspection.topology.speck[t])
            places.push_back((mesh.vertices[i] + mesh.vertices[j] + mesh.vertices[k]) / 3.0);
    }
    doubt(places, kVainSpacing, inspection);
    std::vector<Shortage> at;
    for (const auto& diagonal : inspection.topology.parted)
        for (const Vec3& place : diagonal.beside)
            at.push_back({place, kFaultSpacing * surface_.resolution()});
    inspection.doubts.push_back({{}, 0.0, std::move(at)});
}

std::vector<Shortage> shortages(const FrameMesh& mesh, const Inspection& inspection, const Tetrahedra& cells,
                                const Particles& particles, const Surface& surface,
                                const SizingLimits& limits) {
    std::vector<Shortage> result;
    ThreadProbes probes(surface);
    const CarvedSurface& carved = mesh.carved;
    struct Failing {
        std::size_t triangle;
        std::optional<Shortage> at_crease;  // alone
        std::optional<Vec3> dual;           // the dual crossing of its facet
    };
    const auto dual_of = [&](std::size_t t, bool whole) {
        return whole && carved.inside_cell(t) >= 0
                   ? dual_crossing(cells, particles.position, carved.inside_cell(t), carved.inside_facet(t),
                                   probes.local())
                   : std::nullopt;
    };
    const auto find_failing = [&](std::size_t begin, std::size_t end, std::vector<Failing>& found) {
        for (std::size_t t = begin; t < end; ++t) {
            const auto [corner, whole] = corners_of(carved, t);
            const FacetError& error = (*inspection.errors)[t];
            const auto& [i, j, k] = carved.triangles[t];
            const auto& at = mesh.vertices;  // where a fit put them
            const bool is_sharp = whole && is_sharper(kSharpnessAt18Degrees, at[i], at[j], at[k]);
            if (is_too_far(error, limits.tolerance) || is_turned(error) ||
                (whole && is_needle(particles, corner, limits.detail)) ||
                (is_sharp && angles_matter(particles, corner, limits.detail)))
                found.push_back({t, std::nullopt, dual_of(t, whole)});
            else if (is_sharp)
                if (auto at_crease = crease_shortage(mesh, particles, t, corner, limits.detail))
                    found.push_back({t, at_crease, std::nullopt});
        }
    };
    constexpr std::size_t kTrianglesPerBlock = 1024;
    for (const auto& [t, at_crease, dual] :
         find_in_blocks<Failing>(inspection.errors->size(), kTrianglesPerBlock, find_failing)) {
        if (at_crease) {
            result.push_back(*at_crease);
            continue;
        }
        if (dual) {  // the radius is that of the facet's ball: a flip may have exchanged the corners
            const int on_ball =
                cells.vertices[carved.inside_cell(t)][Tetrahedra::kFacet[carved.inside_facet(t)][0]];
            result.push_back({*dual, (*dual - particles.position[on_ball]).norm()});
        } else if (is_too_far((*inspection.errors)[t], limits.tolerance) || is_flipped(carved, t, cells)) {
            double h = limits.max_edge;
            for (const int p : corners_of(carved, t).particle)
                if (p >= 0) h = std::min(h, particles.spacing[p]);
            result.push_back({(*inspection.errors)[t].where.cast<double>(), 0.7 * h});
        }
    }
    for (const auto& c : inspection.missed)
        result.push_back(
            {c.point, kMissedSpacing * std::max(surface.resolution(), kMissedAt * limits.tolerance)});
    for (const Doubt& doubt : inspection.doubts) {
        for (const Vec3& p : crossings_around(doubt.places, surface))
            result.push_back({p, doubt.spacing, least_spacing(doubt.places.size(), surface)});
        result.insert(result.end(), doubt.at.begin(), doubt.at.end());
    }
    for (const auto& e : carved.complex_edges)
        result.push_back({0.5 * (particles.position[e.from] + particles.position[e.to]),
                          0.7 * std::min(particles.spacing[e.from], particles.spacing[e.to])});
    return result;
}

void report(const FrameMesh& mesh, const Inspection& inspection, const Surface& surface,
            TrackedFrame& frame) {
    const double slope = surface.slope();
    double sum = 0.0, weight = 0.0;
    frame.max_error = inspection.farthest_crossing;
    for (std::size_t t = 0; t < inspection.errors->size(); ++t) {
        const FacetError& error = (*inspection.errors)[t];
        const auto& [i, j, k] = mesh.carved.triangles[t];
        const double area =
            (mesh.vertices[j] - mesh.vertices[i]).cross(mesh.vertices[k] - mesh.vertices[i]).norm();
        frame.max_error = std::max(frame.max_error, error.largest / slope);
        frame.most_turned_deg = std::max<double>(frame.most_turned_deg, error.turned_deg);
        sum += area * error.mean_square / (slope * slope);
        weight += area;
    }
    frame.lost_crossings = inspection.lost_crossings;
    frame.rms_error =
        std::sqrt(std::max(weight > 0.0 ? sum / weight : 0.0, inspection.crossings_mean_square));
    frame.within_tolerance = frame.max_error <= frame.tolerance && frame.lost_crossings == 0 &&
                             frame.most_turned_deg < kTurnedOverDeg;
}

}  // namespace isotrack
