#include "isotrack/tracking/tracker.h"

#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>

#include "beside.h"
#include "delaunay/spatial_order.h"
#include "delaunay/update_cost.h"
#include "isotrack/error.h"
#include "isotrack/meshing/manifold.h"
#include "isotrack/meshing/open_border.h"
#include "isotrack/meshing/untangle.h"
#include "isotrack/sampling/coordinate_descent.h"
#include "isotrack/sampling/cover.h"
#include "isotrack/sampling/delaunay_neighbours.h"
#include "isotrack/sampling/population.h"
#include "isotrack/sampling/relaxation.h"
#include "isotrack/sampling/sizing.h"
#include "meshing/sharpness.h"
#include "numbers_below.h"
#include "parallel_for_each.h"
#include "sampling/creases.h"
#include "surface/float_precision.h"
#include "thread_count.h"
#include "tracking/carry.h"
#include "tracking/failing.h"
#include "tracking/fitted.h"
#include "tracking/making.h"
#include "tracking/stage_timer.h"
#include "tracking/thinning.h"

namespace isotrack {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr int kRounds = 2, kDenseRounds = 3;
constexpr int kMendingSweeps = 3;
constexpr double kAstray = 0.125;  // of the particles: so many newborn at the end of the arrays are too many
constexpr Pace kAtFirst{{}, 0.3, 5}, kDenseAtFirst{{}, 0.3, 7};
// What the mesh can do without goes sooner; where it is too coarse certify finds better places.
constexpr Pace kFollowing{{0.7, 1.1}, 0.3, 3};
constexpr double kThinned = 0.85;      // of the tolerance: error of triangles that close the gap of a death
constexpr double kUnfitted = 1.3;      // times what a fit leaves of an error
constexpr int kMostLayers = 4;         // of newborn around those that move
constexpr double kFewWithError = 0.9;  // of the particles: smooth surfaces have more
constexpr double kThick = 3.0, kThickNodes = 6.0;  // tolerances, resolutions: of a solid without thin parts
constexpr double kMostSeeded = 0.05;  // of the particles; with more the next frame is half a cold start
constexpr double kDetail = 2.0;       // tolerances
constexpr double kDetailOfEdges = 0.25;
constexpr double kLeastEdge = 0.5, kLargestEdge = 40.0;  // details
constexpr double kCrossingsApart = 0.5;  // details: those between are looked at where they may be missed
constexpr double kBandShare = 0.85;      // of the reach: what is beyond the tolerance must be seen, too
// Particles that are added at most, at a tolerance of half a detail. A clean level set takes a quarter of
// that; one with holes in its band would take more than it has lattice edges.
constexpr double kMostPerCrossing = 0.5;
constexpr std::size_t kMostAnyway = 1000;
constexpr double kAngleFloor = 2.0;     // details: sharp edges are as round as they make them
constexpr double kLeastSpacing = 5e-4;  // resolutions: a single node inside may leave no more than that

void round_to_float(Particles& particles) {
    for (Vec3& p : particles.position) p = to_float_precision(p);
}

/// Dense for the paper's sampling, which no certify adds to; otherwise sparse, and wider for the first seeds
/// of a fit.
Sowing sowing_of(const TrackerOptions& options, bool warm) {
    if (options.method == Method::Paper) return kDenseSeeds;
    return options.fit && !warm ? kSparseSeedsFitted : kSparseSeeds;
}

/// What is smaller need not be looked at, world units. In the paper's method the tolerance has no say.
double detail_of(const TrackerOptions& options, const Surface& surface) {
    if (options.method == Method::Paper) return surface.resolution();
    double enough = kDetail * effective_tolerance(options, surface);
    if (options.max_edge) enough = std::min(enough, kDetailOfEdges * *options.max_edge);
    return std::max(surface.resolution(), enough);
}

}  // namespace

Tracker::Impl::Impl(const TrackerOptions& o) : options(o) {
    if (!(o.tolerance > 0.0))
        throw OptionError("the tolerance must be a positive length, got " + std::to_string(o.tolerance));
    if (o.angle_deg && !(*o.angle_deg > 0.0 && *o.angle_deg <= 90.0))
        throw OptionError("the angle must be in (0, 90] degrees, got " + std::to_string(*o.angle_deg));
    if (o.min_edge && !(*o.min_edge > 0.0)) throw OptionError("the smallest edge must be a positive length");
    if (o.max_edge && !(*o.max_edge > 0.0)) throw OptionError("the largest edge must be a positive length");
    if (o.min_edge && o.max_edge && *o.min_edge > *o.max_edge)
        throw OptionError("the smallest edge is longer than the largest");
    dt = make_tetrahedralisation(mesh_strategy());
}

UpdateStrategy Tracker::Impl::strategy() const {
    const bool as_in_paper = options.method == Method::Paper && options.delaunay == UpdateStrategy::Auto;
    return as_in_paper ? UpdateStrategy::Lazy : options.delaunay;
}

UpdateStrategy Tracker::Impl::mesh_strategy() const {
    return options.method == Method::Paper ? UpdateStrategy::Rebuild : options.delaunay;
}

std::optional<double> Tracker::Impl::flips_within(const SizingLimits& l) const {
    if (options.method == Method::Paper) return std::nullopt;
    return kCertified * l.tolerance;
}

void Tracker::Impl::arrange() {
    std::vector<int> order = numbers_below(particles.size());
    sort_along_curve(particles.position, order);
    particles.reorder(order);
    last_mesh.grow(particles.size());
    last_mesh.reorder(order);
    forget_dt();
    first_astray = next_id;
}

bool Tracker::Impl::astray() const {
    const auto count =
        std::count_if(particles.id.begin(), particles.id.end(), [&](Id id) { return id >= first_astray; });
    return static_cast<double>(count) > kAstray * static_cast<double>(particles.size());
}

void Tracker::Impl::tetrahedralise(bool moved, std::map<std::string, double>& seconds,
                                   const std::function<void()>& meanwhile, int busy) {
    round_to_float(particles);
    Beside beside([&] {
        if (meanwhile) meanwhile();
    });
    {
        const StageTimer timer(seconds, "delaunay");
        if (moved) labels.clear();
        bring_dt(moved, std::max(1, thread_count() - busy));
    }
    const StageTimer timer(seconds, "certify");
    beside.wait();
}

void Tracker::Impl::bring_dt(bool moved, int threads) {
    if (in_dt.empty()) {
        dt->assign(particles.position, threads);
    } else {
        // Those that are left are in their old order, the newborn behind them.
        std::size_t next = 0;
        for (std::size_t v = 0; v < in_dt.size(); ++v) {
            if (next == particles.size() || particles.id[next] != in_dt[v]) {
                dt->remove(static_cast<int>(v));
                continue;
            }
            if (moved) dt->move(static_cast<int>(v), particles.position[next]);
            ++next;
        }
        for (; next < particles.size(); ++next) dt->insert(particles.position[next], -1);
        dt->compact();
    }
    in_dt = particles.id;
}

void Tracker::Impl::forget_dt() {
    dt->clear();
    labels = {};
    in_dt = {};
}

bool Tracker::Impl::will_build_anew() const {
    if (mesh_strategy() == UpdateStrategy::Move || mesh_strategy() == UpdateStrategy::Lazy) return false;
    std::size_t moved = 0;
    for (std::size_t i = 0; i < particles.size(); ++i)
        moved += particles.id[i] >= first_of_frame || !particles.velocity[i].isZero(0.0);
    return building_pays(0, moved, 0, particles.size());
}

FrameMesh Tracker::Impl::carve_mesh(const Surface& surface, std::map<std::string, double>& seconds) {
    const StageTimer timer(seconds, "convect");
    std::vector<int> changed = dt->take_changed();
    const Tetrahedra& cells = dt->cells();
    if (labels.empty()) changed = numbers_below(cells.size());
    if (options.reconstruction == Reconstruction::Pure)
        labels = pure_convection(cells, particles.position);
    else
        update_labels(labels, changed, cells, particles.position, particles.normal, surface,
                      detail_of(options, surface));
    return mesh_of(labels, surface);
}

FrameMesh Tracker::Impl::mesh_of(CellLabels& of_cells, const Surface& surface) const {
    const Tetrahedra& cells = dt->cells();
    FrameMesh mesh;
    mesh.carved = carve(cells, of_cells, particles.position);
    if (options.reconstruction == Reconstruction::Guided &&
        untangle(of_cells, cells, particles.position, surface, mesh.carved, detail_of(options, surface)))
        mesh.carved = carve(cells, of_cells, particles.position);
    mesh.vertices = unfitted_vertices(mesh.carved, particles.position);
    return mesh;
}

Densifier Tracker::Impl::make_densifier(const Surface& surface, const SizingLimits& l,
                                        std::size_t crossings) {
    const double finer = std::max(1.0, 0.5 * surface.resolution() / l.tolerance);
    const auto most =
        kMostAnyway + static_cast<std::size_t>(kMostPerCrossing * finer * static_cast<double>(crossings));
    const double least = options.min_edge.value_or(kLeastSpacing * surface.resolution());
    return {particles, surface, l.detail, least, l.max_edge, most, next_id};
}

void Tracker::Impl::inherit_velocities(const std::vector<Triangle>& triangles) {
    std::vector<char> moves(particles.size());
    for (std::size_t i = 0; i < particles.size(); ++i) {
        moves[i] = particles.id[i] < first_of_frame;
        if (!moves[i]) particles.velocity[i].setZero();
    }
    bool any = true;
    for (int layer = 0; any && layer < kMostLayers; ++layer) {
        any = false;
        std::vector<int> count(particles.size(), 0);
        for (const Triangle& t : triangles)
            for (const int i : t)
                for (const int j : t) {
                    if (moves[i] || !moves[j]) continue;
                    particles.velocity[i] += particles.velocity[j];
                    ++count[i];
                }
        for (std::size_t i = 0; i < particles.size(); ++i) {
            if (count[i] == 0) continue;
            any = true;
            particles.velocity[i] /= count[i];
            moves[i] = 1;
        }
    }
}

bool Tracker::Impl::is_thick(const FrameWork& work) const {
    const double least = std::max(kThick * work.limits.tolerance, kThickNodes * work.surface.resolution());
    const std::vector<double>& thickness = last_mesh.evidence.thickness;
    return std::all_of(thickness.begin(), thickness.end(), [&](double thick) { return thick > least; });
}

bool Tracker::Impl::patches() const {
    return options.method != Method::Paper && options.reconstruction == Reconstruction::Guided &&
           !options.min_edge;
}

void Tracker::Impl::prepare_topology(FrameWork& work) const {
    if (is_thick(work)) return;
    work.inspector->prepare_topology();
    if (patches()) work.inspector->lattice_component_count();
}

/// Meshes the particles, and measures what the next births and deaths go by.
void Tracker::Impl::measure(FrameWork& work) {
    constexpr int kSizingSteps = 3;  // barycentric lattice of the samples: with the centroid
    const Surface& surface = work.surface;
    auto& seconds = work.frame.seconds;
    tetrahedralise(true, seconds, [&] { prepare_topology(work); });
    FrameMesh mesh = carve_mesh(surface, seconds);
    if (options.fit) {
        const StageTimer timer(seconds, "fit");
        Fitted().fit_vertices(mesh, particles.size(), surface, flips_within(work.limits));
    }
    const StageTimer timer(seconds, "size");
    last_mesh.evidence.error = errors_at_particles(
        mesh, triangle_errors(mesh.vertices, mesh.carved.triangles, surface, kSizingSteps), particles.size());
    last_mesh.take(mesh.carved, particles, dt->cells());
    last_mesh.make_ring(particles.size());
}

/// The first particles, in order.
void Tracker::Impl::seed(FrameWork& work, const Sowing& sowing) {
    const StageTimer timer(work.frame.seconds, "cover");
    particles = {};
    last_mesh = {};
    work.frame.seeded =
        cover(particles, work.surface, *work.crossings, work.limits, options.seed, next_id, sowing);
    arrange();
}

/// By the first mesh, of a fit: many of its particles have no error.
bool Tracker::Impl::has_flat_faces(const FrameWork& work) const {
    // Of wider seeds fewer lie on flat faces: by the square of the width, and more next to their edges.
    constexpr double kFewerByWidth = 3.0;
    const auto widest = [&](const Sowing& sowing) {
        return widest_seed(sowing, work.surface, *work.crossings, work.limits);
    };
    const double wider = widest(kSparseSeedsFitted) / widest(kSparseSeeds),
                 without_error = 1.0 - share_with_error(last_mesh.evidence, work.limits);
    return without_error * std::pow(wider, kFewerByWidth) > 1.0 - kFewWithError;
}

/// Rounds of: mesh, measure, follow.
void Tracker::Impl::sample(FrameWork& work, bool warm) {
    measure(work);
    // Where flat faces meet nearly all of the mean square is at few particles, and certify adds none for it.
    const bool dense = options.fit && !warm && has_flat_faces(work);
    if (dense) {
        seed(work, kDenseSeeds);
        measure(work);
    }
    const int rounds = dense ? kDenseRounds : kRounds;
    for (int round = 0; round < rounds; ++round) {
        if (round > 0) measure(work);
        follow(work, dense ? kDenseAtFirst : kAtFirst, warm);
        if (!warm) arrange();
    }
}

/// Spreads the particles after others were added among them.
void Tracker::Impl::make_room(const Surface& surface, TrackedFrame& frame) {
    tetrahedralise(false, frame.seconds);
    const FrameMesh mesh = carve_mesh(surface, frame.seconds);
    const StageTimer timer(frame.seconds, "relax");
    last_mesh.take(particle_triangles(mesh.carved));
    last_mesh.make_ring(particles.size());
    frame.sweeps += relax(particles, last_mesh.ring.squared(), surface, kMendingSweeps);
}

/// Spacing, births and deaths, then sweeps, by what the last mesh knows: no DT is needed. Where particles
/// were before this frame none goes unless the mesh can do without it, and none moves without need.
void Tracker::Impl::follow(FrameWork& work, const Pace& pace, bool warm) {
    const Surface& surface = work.surface;
    const SizingLimits& l = work.limits;
    TrackedFrame& frame = work.frame;
    {
        const StageTimer timer(frame.seconds, "size");
        last_mesh.grow(particles.size());
        SizingLimits paced = l;
        paced.thinning = pace.thinning;
        update_spacing(particles, last_mesh.ring, last_mesh.evidence, paced);
    }
    const StageTimer timer(frame.seconds, "relax");
    std::vector<char> keep;
    if (warm) {
        return_to_creases(particles, last_mesh.ring, surface);
        const double enough = (options.fit ? kUnfitted : 1.0) * l.tolerance;
        keep = thin(particles, last_mesh.triangles, last_mesh.ring, surface, *work.crossings,
                    {pace.band.crowded, kThinned * enough, kCertified * enough, l.detail});
    } else {
        keep = uncrowded(particles, last_mesh.ring, pace.band);
    }
    const std::vector<Triangle> parents =
        fill_sparse(particles, last_mesh.triangles, last_mesh.ring, surface, next_id, pace.band);
    last_mesh.grow(particles.size(), parents);
    keep.resize(particles.size(), 1);
    retain(keep);
    const std::vector<char> moving = warm ? restless(l.detail) : std::vector<char>();
    frame.sweeps += relax(particles, last_mesh.ring.squared(moving), surface, pace.sweeps, moving);
}

void Tracker::Impl::retain(const std::vector<char>& keep) {
    if (std::find(keep.begin(), keep.end(), 0) == keep.end()) return;
    tbb::parallel_invoke([&] { particles.retain(keep); }, [&] { last_mesh.retain(keep); });
}

/// Those around triangles that are too sharp, the newborn, and those next to them.
std::vector<char> Tracker::Impl::restless(double detail) const {
    constexpr std::size_t kGrain = 1024;
    const auto is_new = [&](int i) { return particles.id[i] >= first_of_frame; };
    const auto is_sharp = [&](const Triangle& t, double sharpness) {
        const auto& at = particles.position;
        return is_sharper(sharpness, at[t[0]], at[t[1]], at[t[2]]);
    };
    std::vector<std::atomic<char>> found(particles.size());  // by several threads
    parallel_for_each(last_mesh.triangles.size(), kGrain, [&](std::size_t n) {
        const Triangle& t = last_mesh.triangles[n];
        if (std::any_of(t.begin(), t.end(), is_new) || is_sharp(t, kSharpnessAt22Degrees) ||
            (is_sharp(t, kSharpnessAt31Degrees) && angles_matter(particles, t, detail)))
            for (const int i : t) found[i].store(1, std::memory_order_relaxed);
    });
    std::vector<char> result(found.begin(), found.end());
    for (std::size_t i = 0; i < particles.size(); ++i)
        if (is_new(static_cast<int>(i))) result[i] = 1;
    return result;
}

void Tracker::Impl::sample_as_in_paper(const Surface& surface, const SizingLimits& l, bool warm,
                                       TrackedFrame& frame) {
    constexpr int kMostColdSweeps = 60, kMostWarmSweeps = 12;
    if (particles.empty()) return;
    const StageTimer timer(frame.seconds, "relax");
    DelaunayNeighbours structure(strategy(), particles.position);
    CoordinateDescentOptions o;
    o.most_sweeps = warm ? kMostWarmSweeps : kMostColdSweeps;
    o.seed = options.seed;
    const std::size_t count = particles.size();
    const CoordinateDescentReport report = coordinate_descent(particles, structure, surface, l, next_id, o);
    frame.sweeps = static_cast<int>(report.steps / std::max<std::size_t>(1, count));
    frame.relocated = structure.dt().profile().relocated;
}

/// Brings the particles to the surface, and their number and spacing to what it wants.
void Tracker::Impl::place_particles(const Motion& motion, FrameWork& work) {
    const Surface& surface = work.surface;
    const SizingLimits& l = work.limits;
    TrackedFrame& frame = work.frame;
    // Beside the carry, as a registration is in part the work of one thread.
    Beside finding([&] { work.crossings.emplace(surface, kCrossingsApart * detail_of(options, surface)); });
    const auto crossings = [&]() -> const CrossingGrid& {
        finding.wait();
        return work.crossings.value();
    };
    {
        const StageTimer timer(frame.seconds, "carry");
        if (astray()) arrange();
        if (last_mesh.ring.size() == 0) last_mesh.make_ring(particles.size());
        last_mesh.grow(particles.size());  // a frame that failed midway may have left it behind
        const std::vector<char> found = carry(particles, last_mesh.ring, surface, crossings, motion);
        retain(found);
        frame.lost = static_cast<std::size_t>(std::count(found.begin(), found.end(), 0));
    }
    const bool warm = !particles.empty();  // where all are lost as well, the surface is met anew
    {
        const StageTimer timer(frame.seconds, "cover");
        work.inspector.emplace(surface, l, crossings());
        if (warm)
            frame.seeded =
                cover(particles, surface, crossings(), l, options.seed, next_id, sowing_of(options, warm));
    }
    if (!warm) seed(work, sowing_of(options, warm));
    work.follows =
        warm && static_cast<double>(frame.seeded) < kMostSeeded * static_cast<double>(particles.size());
    if (options.method == Method::Paper)
        sample_as_in_paper(surface, l, warm, frame);
    else if (work.follows)
        follow(work, kFollowing, warm);
    else
        sample(work, warm);
}

/// Gives the mesh the ids and velocities of its particles.
void Tracker::Impl::name_vertices(const FrameMesh& mesh, TriangleMesh& named) {
    std::vector<char> seen(particles.size(), 0);
    named.ids.reserve(mesh.carved.particle.size());
    named.velocities.reserve(mesh.carved.particle.size());
    for (const int p : mesh.carved.particle) {
        const bool own = p >= 0 && !seen[p];
        if (own) seen[p] = 1;
        named.ids.push_back(own ? particles.id[p] : next_id++);
        named.velocities.push_back(p >= 0 ? particles.velocity[p] : Vec3::Zero());
    }
}

Tracker::Finish Tracker::Impl::begin(const Surface& surface, const Motion& motion) {
    const auto work =
        std::make_shared<FrameWork>(FrameWork{surface, sizing_limits(options, surface), {}, {}, {}, {}, {}});
    TrackedFrame& frame = work->frame;
    frame.tolerance = effective_tolerance(options, surface);
    frame.delaunay_strategy = name_of(strategy());
    const std::size_t relocated = dt->profile().relocated, built = dt->profile().build.calls,
                      before = particles.size();
    first_of_frame = next_id;

    place_particles(motion, *work);
    {  // which frees what is of no use to a mesh that passes
        Making making(*this, *work);
        making.mesh_particles();
        making.certify();
        if (will_build_anew()) forget_dt();  // first: much memory, of no use from here on
        making.patch();
        if (options.method != Method::Paper &&
            making.is_of_particles())  // the next births and deaths go by what is left of errors
            last_mesh.evidence.error =
                errors_at_particles(work->mesh, *work->inspection.errors, particles.size());
        inherit_velocities(making.is_of_particles() ? particle_triangles(work->mesh.carved)
                                                    : last_mesh.triangles);
    }
    frame.relocated += dt->profile().relocated - relocated;
    frame.rebuilt = dt->profile().build.calls - built;
    name_vertices(work->mesh, frame.mesh);
    frame.particles = particles.size();
    for (const Id id : particles.id) frame.born += id >= first_of_frame;
    frame.died = before + frame.born - particles.size();
    if (options.border == Border::Close) return [work, options = options] { return work->finish(options); };

    frame = work->finish(options);  // ids of what is cut open are given in the order of the frames
    std::vector<char> at_border;
    for (const Vec3& p : frame.mesh.points) at_border.push_back(surface.at_border(p));
    frame.opened = open_border(frame.mesh, at_border, next_id) > 0;
    return [work] { return std::move(work->frame); };
}

double effective_tolerance(const TrackerOptions& options, const Surface& surface) {
    return std::min(options.tolerance, kBandShare * surface.reach());
}

SizingLimits sizing_limits(const TrackerOptions& options, const Surface& surface) {
    const double detail = detail_of(options, surface);
    SizingLimits l{};
    l.tolerance = effective_tolerance(options, surface) * std::min(1.0, surface.slope() / kFullSlope);
    l.angle = options.angle_deg.value_or(default_angle_deg(options.method)) * kPi / 180.0;
    l.angle_floor = kAngleFloor * detail;
    l.detail = detail;
    l.min_edge = options.min_edge.value_or(kLeastEdge * detail);
    l.max_edge = std::max(options.max_edge.value_or(kLargestEdge * detail), l.min_edge);
    l.mean_square_counts = options.fit;
    return l;
}

double default_angle_deg(Method method) {
    return method == Method::Paper ? 20.0 : 60.0;
}

Tracker::Tracker(const TrackerOptions& options) : impl_(std::make_unique<Impl>(options)) {}
Tracker::~Tracker() = default;
Tracker::Tracker(Tracker&&) noexcept = default;
Tracker& Tracker::operator=(Tracker&&) noexcept = default;
TrackedFrame Tracker::advance(const Surface& surface, const Motion& motion) {
    return begin(surface, motion)();
}
Tracker::Finish Tracker::begin(const Surface& surface, const Motion& motion) {
    return impl_->begin(surface, motion);
}
const Particles& Tracker::particles() const {
    return impl_->particles;
}

}  // namespace isotrack
