// How the DT follows moving particles: the experiment behind the paper's table 1, and warm frames by the
// share of particles that moved, made up and of sequences.
//
//     isotrack_update_strategies --particles 3000 --half-axes 1 0.75 0.5 --frames 5000 50000 500000
//     isotrack_update_strategies --sequences 'liquid.####.vdb' folder --tolerances 0.5 0.05
//
// First table: particles crowded at the tips of an ellipsoid spread until they rest, none is born or dies.
// The paper does not give the axes of its ellipsoid. Ours are three different ones: in a body of revolution
// every largest ball touches the surface along a whole circle, so the DT has flat cells between four
// particles of a circle, which turn over at the smallest move: most moves then break the embedding, and at
// two points of four each lazy cannot put off more than every second of those.
// "sweeps" is what the tracker does: sweeps over all particles at once, neighbours within two rings of the
// mesh, the DT built anew between batches of them, the particles carried on along their last displacements.
// Energy: mean over the particles of sum exp(-r^2 / sigma^2) with sigma = d / sqrt(2), d the spacing of a
// hexagonal packing of as many particles on that area. Second table: time to settle over that of rebuild.
// Third table, of sequences, instead: the same for the particles that the tracker has in a frame and in the
// next one, medians over the frames.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <exception>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <tuple>
#include <unordered_map>
#include <vector>

#include "isotrack/delaunay/tetrahedralisation.h"
#include "isotrack/error.h"
#include "isotrack/io/sequence.h"
#include "isotrack/io/vdb_file.h"
#include "isotrack/sampling/delaunay_neighbours.h"
#include "isotrack/sampling/particle_grid.h"
#include "isotrack/sampling/relaxation.h"
#include "isotrack/surface/level_set.h"
#include "isotrack/surface/shapes.h"
#include "isotrack/tracking/tracker.h"

namespace isotrack::bench {
namespace {

constexpr double kPi = 3.14159265358979323846;

double now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

Vec3 on_ellipsoid(const Vec3& half_axes, double theta, double phi) {
    return half_axes.cwiseProduct(
        Vec3(std::cos(theta), std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi)));
}

/// The spacing of a hexagonal packing of `count` particles on the ellipsoid.
double hexagonal_spacing(const Vec3& half_axes, std::size_t count) {
    constexpr int kSteps = 500;
    constexpr double kStep = kPi / kSteps;
    double area = 0.0;
    for (int i = 0; i < kSteps; ++i)
        for (int j = 0; j < 2 * kSteps; ++j) {
            const auto at = [&](double a, double b) {
                return on_ellipsoid(half_axes, (i + a) * kStep, (j + b) * kStep);
            };
            area += (at(1.0, 0.5) - at(0.0, 0.5)).cross(at(0.5, 1.0) - at(0.5, 0.0)).norm();
        }
    return std::sqrt(2.0 * area / (std::sqrt(3.0) * static_cast<double>(count)));
}

/// Uniform in latitude and longitude: crowded at the tips, and at random.
Particles bad_start(const Surface& surface, const Vec3& half_axes, std::size_t count, double spacing) {
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    const auto probe = surface.probe();
    Particles particles;
    while (particles.size() < count) {
        const double theta = kPi * unit(random);
        const auto p = probe->project(on_ellipsoid(half_axes, theta, 2.0 * kPi * unit(random)));
        if (p) particles.add(*p, probe->normal(*p), spacing, static_cast<Id>(particles.size()));
    }
    return particles;
}

struct Packing {
    double energy = 0.0, smallest = 1e300;  // spacing
};

Packing packing_of(const Particles& particles, double hexagonal) {
    PointGrid grid(particles.position, 2.0 * hexagonal);
    grid.take_new();
    Packing result;
    for (std::size_t i = 0; i < particles.size(); ++i)
        grid.for_each_within(particles.position[i], 3.0 * hexagonal, [&](int j, double d2) {
            if (j == static_cast<int>(i)) return;
            result.energy += std::exp(-2.0 * d2 / (hexagonal * hexagonal));
            result.smallest = std::min(result.smallest, std::sqrt(d2));
        });
    result.energy /= static_cast<double>(particles.size());
    return result;
}

/// The mesh: of a convex body its particles' hull.
std::vector<Triangle> hull_of(const Tetrahedra& cells) {
    std::vector<Triangle> result;
    for (std::size_t c = 0; c < cells.size(); ++c) {
        const auto cell = static_cast<int>(c);
        if (!cells.is_infinite(cell)) continue;
        const auto& v = cells.vertices[c];
        const auto& f = Tetrahedra::kFacet[cells.index_of(cell, Tetrahedra::kInfinite)];
        result.push_back({v[f[0]], v[f[1]], v[f[2]]});
    }
    return result;
}

/// Of every particle the mean over itself and its neighbours.
void smooth(std::vector<Vec3>& field, const Adjacency& adjacency) {
    std::vector<Vec3> result = field;
    for (std::size_t i = 0; i < field.size(); ++i) {
        for (const int j : adjacency.of(i)) result[i] += field[j];
        result[i] /= static_cast<double>(1 + adjacency.of(i).size());
    }
    field.swap(result);
}

/// Ends with the DT of where the particles came to rest.
void spread_by_sweeps(Particles& particles, Tetrahedralisation& dt, const Surface& surface, double spacing) {
    // Sweeps part neighbours at once, but a crowd gets across the surface by diffusion only: its particles go
    // the same way, batch after batch. So each batch is extrapolated, and by much. Only what particles near
    // each other have in common may be: each by its own displacement they would meet.
    constexpr int kSweeps = 8, kSmoothings = 6, kMostBatches = 100;
    double extrapolation = 4.0;
    // Of sigma, per sweep, the mean over the particles: half of what the paper calls rest for one of them.
    constexpr double kRest = 0.025;
    const auto probe = surface.probe();
    const std::size_t count = particles.size();
    double moved_before = std::numeric_limits<double>::infinity();
    dt.assign(particles.position);
    for (int batch = 0; batch < kMostBatches; ++batch) {
        const Adjacency two_rings = ring_of(hull_of(dt.cells()), count).squared();
        std::vector<Vec3> displacement = particles.position;
        relax(particles, two_rings, surface, kSweeps);
        double moved = 0.0;
        for (std::size_t i = 0; i < count; ++i) {
            displacement[i] = particles.position[i] - displacement[i];
            moved += displacement[i].norm();
        }
        const bool at_rest = moved <= kRest * spacing / std::sqrt(2.0) * kSweeps * static_cast<double>(count);
        if (!at_rest) {
            if (moved > moved_before) extrapolation *= 0.5;  // they were carried too far
            moved_before = moved;
            for (int pass = 0; pass < kSmoothings; ++pass) smooth(displacement, two_rings);
            for (std::size_t i = 0; i < count; ++i)
                if (const auto p = probe->project(particles.position[i] + extrapolation * displacement[i])) {
                    particles.position[i] = *p;
                    particles.normal[i] = probe->normal(*p);
                }
        }
        dt.assign(particles.position);
        if (at_rest) return;
    }
}

void print_row(const std::string& name, double seconds, const UpdateProfile& profile, const Packing& packing,
               double hexagonal) {
    const auto part = [&](const UpdateProfile::Row& row) {
        return fmt::format("{} / {:.0f} %", row.calls, 100.0 * row.seconds / seconds);
    };
    fmt::print("| {} | {:.2f} | {} | {} | {} | {} | {} | {:.4f} | {:.3f} |\n", name, seconds,
               part(profile.remove), part(profile.insert), part(profile.locate), part(profile.predicates),
               part(profile.build), packing.energy, packing.smallest / hexagonal);
}

void spread(std::size_t count, const Vec3& half_axes) {
    const auto ellipsoid = shapes::ellipsoid({0, 0, 0}, half_axes, 0.01);
    const double hexagonal = hexagonal_spacing(half_axes, count);
    SizingLimits limits{};
    limits.tolerance = 1.0;
    limits.angle = 1.0;
    limits.min_edge = limits.max_edge = hexagonal;
    const Particles start = bad_start(*ellipsoid, half_axes, count, hexagonal);
    const Packing before = packing_of(start, hexagonal);
    fmt::print(
        "{} particles on an ellipsoid, energy {:.4f} at the start, smallest spacing {:.4f} of the "
        "hexagonal.\n\n",
        count, before.energy, before.smallest / hexagonal);
    fmt::print(
        "| update | seconds | remove: calls / time | insert | locate | predicates | build | energy | "
        "smallest spacing |\n");
    fmt::print("|---|---:|---:|---:|---:|---:|---:|---:|---:|\n");
    double lazy_energy = 0.0, lazy_seconds = 0.0;
    std::size_t moved_removals = 0, lazy_removals = 0;
    for (const UpdateStrategy strategy :
         {UpdateStrategy::Move, UpdateStrategy::Lazy, UpdateStrategy::Rebuild, UpdateStrategy::Auto}) {
        Particles particles = start;
        CoordinateDescentOptions options;
        options.population = false;
        options.most_sweeps = 200;
        Id next_id = static_cast<Id>(count);
        const double from = now();
        DelaunayNeighbours structure(strategy, particles.position);
        coordinate_descent(particles, structure, *ellipsoid, limits, next_id, options);
        structure.dt().settle();
        const double seconds = now() - from;
        const Packing packing = packing_of(particles, hexagonal);
        print_row(name_of(strategy), seconds, structure.dt().profile(), packing, hexagonal);
        if (strategy == UpdateStrategy::Move) moved_removals = structure.dt().profile().remove.calls;
        if (strategy != UpdateStrategy::Lazy) continue;
        lazy_energy = packing.energy;
        lazy_seconds = seconds;
        lazy_removals = structure.dt().profile().remove.calls;
    }

    Particles particles = start;
    const auto dt = make_tetrahedralisation(UpdateStrategy::Auto);
    const double from = now();
    spread_by_sweeps(particles, *dt, *ellipsoid, hexagonal);
    const double seconds = now() - from;
    const Packing packing = packing_of(particles, hexagonal);
    print_row("sweeps", seconds, dt->profile(), packing, hexagonal);
    fmt::print(
        "\nlazy removes {:.1f} times less often than move; sweeps rest {:.1f} times sooner than lazy, at "
        "{:.2f} times its energy.\n\n",
        static_cast<double>(moved_removals) / static_cast<double>(std::max<std::size_t>(1, lazy_removals)),
        lazy_seconds / seconds, packing.energy / lazy_energy);
}

/// What it costs to bring a DT from positions to positions: of rebuild in ms, of move, lazy and auto in times
/// that. None: left out.
using Costs = std::array<std::optional<double>, 4>;

constexpr std::array<UpdateStrategy, 4> kFollowing = {UpdateStrategy::Rebuild, UpdateStrategy::Move,
                                                      UpdateStrategy::Lazy, UpdateStrategy::Auto};

std::size_t count_moved(const std::vector<Vec3>& from, const std::vector<Vec3>& to) {
    std::size_t result = 0;
    for (std::size_t i = 0; i < from.size(); ++i) result += from[i] != to[i];
    return result;
}

/// Those that take particles one after the other are left out where more than `most_moves` move.
Costs costs_to_follow(const std::vector<Vec3>& from, const std::vector<Vec3>& to, std::size_t most_moves) {
    const bool too_many = count_moved(from, to) > most_moves;
    Costs result;
    double rebuild = 0.0;
    for (std::size_t s = 0; s < kFollowing.size(); ++s) {
        const UpdateStrategy strategy = kFollowing[s];
        if (too_many && (strategy == UpdateStrategy::Move || strategy == UpdateStrategy::Lazy)) continue;
        const auto dt = make_tetrahedralisation(strategy);
        dt->assign(from);
        dt->cells();
        const double start = now();
        for (std::size_t i = 0; i < from.size(); ++i)
            if (from[i] != to[i]) dt->move(static_cast<int>(i), to[i]);
        dt->settle();
        dt->cells();
        const double seconds = now() - start;
        if (strategy == UpdateStrategy::Rebuild) rebuild = seconds;
        result[s] = strategy == UpdateStrategy::Rebuild ? 1e3 * seconds : seconds / rebuild;
    }
    return result;
}

void print_costs(const Costs& costs) {
    for (std::size_t s = 0; s < costs.size(); ++s)
        fmt::print(" {} |", costs[s] ? fmt::format("{:.{}f}", *costs[s], s == 0 ? 0 : 2) : "-");
    fmt::print("\n");
}

/// A share of relaxed particles moves by a tenth of the spacing along the surface.
void warm_frame(std::size_t count, const Vec3& half_axes, std::size_t most_moves) {
    const auto ellipsoid = shapes::ellipsoid({0, 0, 0}, half_axes, 0.01);
    const double hexagonal = hexagonal_spacing(half_axes, count);
    Particles particles = bad_start(*ellipsoid, half_axes, count, hexagonal);
    for (int round = 0; round < 4; ++round)
        relax(particles, vertex_adjacency(tetrahedralise(particles.position), count), *ellipsoid, 3);
    const auto probe = ellipsoid->probe();
    for (const double share : {0.01, 0.03, 0.1, 0.3, 1.0}) {
        std::mt19937_64 random(2);
        std::uniform_real_distribution<double> unit(-1.0, 1.0);
        std::vector<Vec3> to = particles.position;
        for (std::size_t i = 0; i < count; ++i) {
            if (0.5 * (unit(random) + 1.0) >= share) continue;
            const Vec3 step(unit(random), unit(random), unit(random));
            if (const auto p = probe->project(particles.position[i] + 0.1 * hexagonal * step)) to[i] = *p;
        }
        fmt::print("| {} | {:.0f} % |", count, 100.0 * share);
        print_costs(costs_to_follow(particles.position, to, most_moves));
    }
}

/// Of the particles that live in both of two frames that follow each other.
struct Pair {
    std::vector<Vec3> from, to;
    std::size_t farther = 0;  ///< How many moved by more than a tenth of their spacing.
};

Pair pair_of(const Particles& before, const Particles& after) {
    std::unordered_map<Id, std::size_t> place;
    for (std::size_t i = 0; i < before.size(); ++i) place.emplace(before.id[i], i);
    Pair result;
    for (std::size_t i = 0; i < after.size(); ++i) {
        const auto found = place.find(after.id[i]);
        if (found == place.end()) continue;
        const Vec3& from = before.position[found->second];
        result.from.push_back(from);
        result.to.push_back(after.position[i]);
        if ((after.position[i] - from).norm() > 0.1 * after.spacing[i]) ++result.farther;
    }
    return result;
}

double median(std::vector<double> values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

/// A row of medians over the pairs of frames.
void follow_sequence(const std::string& input, double tolerance_voxels, std::size_t most_moves) {
    std::optional<Tracker> tracker;
    Particles before;
    std::vector<double> particles, moved, farther;
    std::array<std::vector<double>, std::tuple_size_v<Costs>> costs;
    for (const InputFrame& frame : find_frames({input}).frames) {
        const LevelSet surface(read_grid(frame.path, choose_grid(list_grids(frame.path), {}, frame.path)));
        if (!tracker) {
            TrackerOptions options;
            options.tolerance = tolerance_voxels * surface.voxel_size();
            tracker.emplace(options);
        }
        tracker->advance(surface);
        const Pair pair = pair_of(before, tracker->particles());
        before = tracker->particles();
        if (pair.from.empty()) continue;
        const auto count = static_cast<double>(pair.from.size());
        particles.push_back(count);
        moved.push_back(100.0 * static_cast<double>(count_moved(pair.from, pair.to)) / count);
        farther.push_back(100.0 * static_cast<double>(pair.farther) / count);
        const Costs of_pair = costs_to_follow(pair.from, pair.to, most_moves);
        for (std::size_t s = 0; s < costs.size(); ++s)
            if (of_pair[s]) costs[s].push_back(*of_pair[s]);
    }
    if (particles.empty()) throw InputError(input + ": no two frames with particles that live in both");
    Costs medians;
    for (std::size_t s = 0; s < costs.size(); ++s)
        if (!costs[s].empty()) medians[s] = median(costs[s]);
    fmt::print("| {} | {} | {} | {:.0f} | {:.0f} % | {:.0f} % |", input, tolerance_voxels, particles.size(),
               median(particles), median(moved), median(farther));
    print_costs(medians);
}

}  // namespace
}  // namespace isotrack::bench

int main(int argc, char** argv) {
    using namespace isotrack::bench;
    CLI::App app{"How the Delaunay tetrahedralisation follows moving particles"};
    std::size_t particles = 3000, most_moves = 100000;
    std::array<double, 3> axes = {1.0, 0.75, 0.5};
    std::vector<std::size_t> frames = {5000, 50000, 500000};
    std::vector<std::string> sequences;
    std::vector<double> tolerances = {0.5};
    app.add_option("--particles", particles, "On the ellipsoid")->capture_default_str();
    app.add_option("--half-axes", axes, "Of the ellipsoid")->capture_default_str();
    app.add_option("--frames", frames, "Sizes of warm frames")->capture_default_str();
    app.add_option("--sequences", sequences,
                   "Patterns or folders of VDB files, each a sequence: the table of these, and no other");
    app.add_option("--tolerances", tolerances, "Of the sequences, in voxels: a row for each")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    app.add_option("--most-moves", most_moves,
                   "Where more particles move, move and lazy, which take minutes then, are left out")
        ->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    constexpr const char* kColumns = "rebuild, ms | move, times that | lazy | auto |";
    try {
        if (sequences.empty()) {
            const isotrack::Vec3 half_axes(axes[0], axes[1], axes[2]);
            spread(particles, half_axes);
            fmt::print("| particles | moved | {}\n|---:|---:|---:|---:|---:|---:|\n", kColumns);
            for (const std::size_t count : frames) warm_frame(count, half_axes, most_moves);
        } else {
            fmt::print(
                "| sequence | tolerance, voxels | pairs of frames | particles in both | moved | farther than "
                "a tenth of their spacing | {}\n|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n",
                kColumns);
            for (const std::string& sequence : sequences)
                for (const double tolerance : tolerances) follow_sequence(sequence, tolerance, most_moves);
        }
        fmt::print("\nWhere more than {} particles move, move and lazy take minutes and are left out.\n",
                   most_moves);
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
}
