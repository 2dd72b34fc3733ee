// What becomes of a mesh on solids whose motion is known, over frames: does it grow, do its ids stay, are its
// velocities right. Nobody tells the tracker how they move.
//
//     isotrack_motions --frames 12
//
// Prints a table, and below it which wanted figures are missed.
#include <fmt/format.h>
#include <openvdb/openvdb.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <set>
#include <string>
#include <vector>

#include "isotrack/surface/level_set.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"
#include "isotrack/tracking/tracker.h"

namespace isotrack::bench {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kMostGrowth = 1.2, kMostBirths = 0.03, kMostVelocityError = 0.05;  // wanted

struct Motion {
    std::string name;
    double degrees, drift;  // a frame; voxels
};

struct Solid {
    std::string name;
    shapes::SurfacePtr surface;
};

std::vector<Solid> make_solids(double voxel) {
    const auto bumps = [](const Vec3& p) {
        const Eigen::Array3d s = (22.0 * p.array()).sin();
        return (p.norm() - 0.45 - 0.02 * s.prod()) / 1.3;
    };
    const Vec3 reach = Vec3::Constant(0.5);
    return {
        {"ellipsoid", shapes::ellipsoid({0, 0, 0}, {0.5, 0.35, 0.22}, voxel)},
        {"ring", shapes::unite({shapes::torus({0, 0, 0}, 0.38, 0.12, voxel),  // whose knob shows how it turns
                                shapes::sphere({0.38, 0, 0}, 0.16, voxel)})},
        {"box", shapes::box({0, 0, 0}, {0.4, 0.3, 0.2}, voxel)},
        {"bumps", shapes::from_function(bumps, Box(-reach, reach), voxel)}};
}

struct Result {
    std::size_t first = 0, last = 0, anew = 0;  // triangles
    double born = 0.0;                          // share of the particles a frame
    double kept = 0.0;                          // share of the ids of the first frame that are in the last
    double speed = 0.0, velocity_error = 0.0;   // voxels a frame, mean and median, of all warm frames
    double error = 0.0;                         // voxels, largest of all frames
    double milliseconds = 0.0;                  // of a warm frame
};

Result follow(const Solid& solid, const Motion& motion, int frames, double voxel) {
    TrackerOptions options;
    options.tolerance = 0.5 * voxel;
    Tracker tracker(options);
    Result result;
    const Eigen::AngleAxisd turn(motion.degrees * kPi / 180.0, Vec3(1, 2, 3).normalized());
    const Eigen::Translation3d drift(motion.drift * voxel * Vec3(1, 0.5, 0.2).normalized());
    Eigen::Isometry3d place(Eigen::Translation3d(0.013, 0.007, 0.003)), before = place;
    std::set<Id> at_first;
    std::vector<double> off;
    double speeds = 0.0, particles = 0.0;
    for (int f = 0; f < frames; ++f) {
        const LevelSet level_set(rasterise(*shapes::moved(solid.surface, place), voxel));
        const auto start = std::chrono::steady_clock::now();
        const TrackedFrame frame = tracker.advance(level_set);
        const double seconds =
            std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        result.error = std::max(result.error, frame.max_error / voxel);
        result.last = frame.mesh.triangles.size();
        const std::set<Id> ids(frame.mesh.ids.begin(), frame.mesh.ids.end());
        if (f == 0) {
            result.first = result.last;
            at_first = ids;
        } else {
            result.milliseconds += 1e3 * seconds / (frames - 1);
            result.born += static_cast<double>(frame.born);
            particles += static_cast<double>(frame.particles);
            const Eigen::Isometry3d back = before * place.inverse();
            for (std::size_t v = 0; v < frame.mesh.points.size(); ++v) {
                const Vec3 moved = frame.mesh.points[v] - back * frame.mesh.points[v];
                off.push_back((frame.mesh.velocities[v] - moved).norm() / voxel);
                speeds += moved.norm() / voxel;
            }
        }
        if (f + 1 == frames) {
            result.kept = static_cast<double>(std::count_if(at_first.begin(), at_first.end(),
                                                            [&](Id id) { return ids.count(id) > 0; })) /
                          static_cast<double>(at_first.size());
            result.anew = Tracker(options).advance(level_set).mesh.triangles.size();
        }
        before = place;
        place = drift * place * turn;
    }
    result.born /= particles;
    result.speed = speeds / static_cast<double>(off.size());
    std::nth_element(off.begin(), off.begin() + static_cast<std::ptrdiff_t>(off.size() / 2), off.end());
    result.velocity_error = off[off.size() / 2];
    return result;
}

int run(int frames, double voxel) {
    const Motion motions[] = {
        {"rests", 0.0, 0.0}, {"drifts", 0.0, 0.7}, {"turns", 1.0, 0.0}, {"turns fast", 4.0, 0.5}};
    fmt::print(
        "| solid | motion | voxels a frame | triangles at first | after {} frames | met anew there | born a "
        "frame | "
        "ids of the first frame left | velocity off, voxels | largest error, voxels | ms a frame |\n"
        "|---|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|\n",
        frames);
    std::string missed;
    for (const Solid& solid : make_solids(voxel))
        for (const Motion& motion : motions) {
            const Result r = follow(solid, motion, frames, voxel);
            fmt::print(
                "| {} | {} | {:.2f} | {} | {} | {} | {:.1f} % | {:.0f} % | {:.3f} | {:.3f} | {:.0f} |\n",
                solid.name, motion.name, r.speed, r.first, r.last, r.anew, 100.0 * r.born, 100.0 * r.kept,
                r.velocity_error, r.error, r.milliseconds);
            std::fflush(stdout);
            const auto miss = [&](bool bad, const std::string& text) {
                if (bad) missed += fmt::format("- {} that {}: {}\n", solid.name, motion.name, text);
            };
            const double growth = static_cast<double>(r.last) / static_cast<double>(r.anew);
            miss(growth > kMostGrowth, fmt::format("{:.2f} times the triangles of a mesh made anew", growth));
            miss(r.born > kMostBirths, fmt::format("{:.1f} % born a frame", 100.0 * r.born));
            miss(r.velocity_error > kMostVelocityError * std::max(1.0, r.speed),
                 fmt::format("velocities {:.3f} voxels off", r.velocity_error));
            miss(r.error > 0.5, fmt::format("error {:.3f}", r.error));
        }
    fmt::print(
        "\nWanted: at most {:.1f} times the triangles of a mesh made anew, {:.0f} % born a frame, velocities "
        "off by "
        "{:.0f} % of the speed or of a voxel, errors of half a voxel.\nMissed:{}\n{}",
        kMostGrowth, 100.0 * kMostBirths, 100.0 * kMostVelocityError, missed.empty() ? " nothing." : "",
        missed);
    return 0;
}

}  // namespace
}  // namespace isotrack::bench

int main(int argc, char** argv) {
    int frames = 12;
    double voxel = 0.005;
    CLI::App app{"Meshes of solids whose motion is known"};
    app.add_option("--frames", frames)->check(CLI::Range(2, 1000))->capture_default_str();
    app.add_option("--voxel", voxel, "World units; the solids fill a unit cube")
        ->check(CLI::Range(0.001, 0.1))
        ->capture_default_str();
    try {
        openvdb::initialize();
        app.parse(argc, argv);
        return isotrack::bench::run(frames, voxel);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? 0 : 2;
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
}
