// Meshes of one level set by isotrack and by what users would take instead, measured alike, in one run.
//
//     isotrack_peers 'sim/water.####.vdb' --measure 3
//
// One row per method and measured frame, columns as of isotrack compare. isotrack follows all frames, the
// others start anew. Decimation and remeshing make about as many triangles as isotrack --fit.
// make_surface_mesh runs at a fixed distance bound, and at those bounds where its largest error is that of
// isotrack. Two more columns for isotrack: `triangles_over`, its triangles over those of make_surface_mesh at
// its own largest error, and `rms_over`, the RMS error of isotrack --fit over that of decimation.
#include <fmt/format.h>
#include <openvdb/openvdb.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "bench/peer_meshers.h"
#include "cli/table.h"
#include "isotrack/compare/baselines.h"
#include "isotrack/compare/metrics.h"
#include "isotrack/error.h"
#include "isotrack/io/sequence.h"
#include "isotrack/io/vdb_file.h"
#include "isotrack/surface/level_set.h"
#include "isotrack/tracking/mesh_sequence.h"
#include "isotrack/tracking/tracker.h"

namespace isotrack::bench {
namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
    std::vector<std::string> inputs;
    std::string frames, grid, tolerance = "0.5vx", distance = "0.3vx";
    double iso = 0.0;
    std::size_t triangles = 0, measure = 1;
    bool remeshing = true, csv = false, json = false;
};

LevelSet read_level_set(const std::string& path, const Arguments& arguments) {
    std::optional<std::string> wanted;
    if (!arguments.grid.empty()) wanted = arguments.grid;
    LevelSetOptions options;
    options.iso = arguments.iso;
    return LevelSet(read_grid(path, choose_grid(list_grids(path), wanted, path)), options);
}

struct Made {
    TriangleMesh mesh;
    double seconds = 0.0;
};

/// The least time of `repeats` runs.
Made timed(const std::function<TriangleMesh()>& make, int repeats = 1) {
    Made best;
    for (int i = 0; i < repeats; ++i) {
        const auto start = std::chrono::steady_clock::now();
        TriangleMesh mesh = make();
        const double seconds =
            std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        if (i == 0 || seconds < best.seconds) best = {std::move(mesh), seconds};
    }
    return best;
}

double rms(const MeshMetrics& m) {
    return std::max(m.to_rms, m.from_rms);
}

double area(const TriangleMesh& mesh) {
    double sum = 0.0;
    for (const auto& [a, b, c] : mesh.triangles)
        sum += 0.5 * (mesh.points[b] - mesh.points[a]).cross(mesh.points[c] - mesh.points[a]).norm();
    return sum;
}

/// Remeshed to about `triangles`; the time is that of the run kept.
Made remesh_to_count(const TriangleMesh& mesh, std::size_t triangles) {
    const double wanted = static_cast<double>(std::max<std::size_t>(triangles, 4));
    double edge = std::sqrt(4.0 * area(mesh) / (std::sqrt(3.0) * wanted));  // equilateral
    Made made;
    for (int run = 0; run < 2;
         ++run) {  // edges come out shorter than asked for: the second run makes up for it
        made = timed([&] { return remesh(mesh, edge); });
        edge *= std::sqrt(static_cast<double>(made.mesh.triangles.size()) / wanted);
    }
    return made;
}

/// make_surface_mesh at several distance bounds, measured.
class EqualError {
public:
    struct Run {
        double bound = 0.0;  ///< World units.
        double seconds = 0.0;
        MeshMetrics metrics;
        double error() const { return metrics.error_max(); }
    };

    EqualError(const ImplicitMesher& mesher, const LevelSet& level_set)
        : mesher_(mesher), level_set_(level_set) {}

    const Run& at(double bound) {
        const Made made = timed([&] { return mesher_.mesh(bound); });
        runs_.push_back({bound, made.seconds, measure(made.mesh, level_set_)});
        return runs_.back();
    }

    /// More runs until one has a largest error within 2 % of `error` (voxels), by bisection on the bound as
    /// far as that goes, and four have one within 25 %.
    void approach(double error) {
        constexpr int kMostRuns = 8;
        constexpr std::size_t kNear = 4;
        constexpr double kClose = 1.02, kNarrow = 1.01, kStep = 1.05;
        int runs = 0;
        for (; runs < kMostRuns && miss(nearest(error), error) > std::log(kClose); ++runs) {
            const Run *low = nullptr,
                      *high = nullptr;  // the largest bound that is good enough, the next one up
            for (const Run& r : runs_)
                if (r.error() <= error && (!low || r.bound > low->bound)) low = &r;
            for (const Run& r : runs_)
                if ((!low || r.bound > low->bound) && (!high || r.bound < high->bound)) high = &r;
            if (low && high && high->bound < kNarrow * low->bound) break;
            at(low && high ? std::sqrt(low->bound * high->bound)
               : low       ? low->bound * std::max(kStep, error / low->error())
                           : high->bound * std::min(1.0 / kStep, error / high->error()));
        }
        const double middle = nearest(error).bound;
        for (double step = kStep; runs < kMostRuns && near(error).size() < kNear; ++runs) {
            at(middle * step);
            step = step > 1.0 ? 1.0 / step : kStep / step;
        }
    }

    /// The run whose largest error is nearest to `error`.
    const Run& nearest(double error) const {
        return *std::min_element(runs_.begin(), runs_.end(),
                                 [&](const Run& a, const Run& b) { return miss(a, error) < miss(b, error); });
    }

    /// Triangles at a largest error of `error`. The largest error of a run wavers by a tenth from one bound,
    /// even from one run, to the next, so this is the geometric mean over the runs within 25 %, each scaled
    /// as count ~ 1 / error. Nothing without such a run.
    std::optional<double> triangles(double error) const {
        const std::vector<const Run*> runs = near(error);
        if (runs.empty()) return std::nullopt;
        double sum = 0.0;
        for (const Run* r : runs)
            sum += std::log(static_cast<double>(r->metrics.topology.triangles) * r->error() / error);
        return std::exp(sum / static_cast<double>(runs.size()));
    }

private:
    static double miss(const Run& run, double error) { return std::abs(std::log(run.error() / error)); }
    std::vector<const Run*> near(double error) const {
        constexpr double kNearFactor = 1.25;
        std::vector<const Run*> result;
        for (const Run& r : runs_)
            if (miss(r, error) < std::log(kNearFactor)) result.push_back(&r);
        return result;
    }

    const ImplicitMesher& mesher_;
    const LevelSet& level_set_;
    std::vector<Run> runs_;
};

Json make_row(int frame, const std::string& method, const MeshMetrics& m, double seconds) {
    const MeshTopology& t = m.topology;
    Json row;
    row["frame"] = frame;
    row["method"] = method;
    row["triangles"] = t.triangles;
    row["vertices"] = t.vertices;
    row["seconds"] = seconds;
    row["to_max_vx"] = m.to_max;
    row["to_rms_vx"] = m.to_rms;
    row["from_max_vx"] = m.from_max;
    row["from_rms_vx"] = m.from_rms;
    row["min_angle_deg"] = m.min_angle_deg;
    row["angle_p1_deg"] = m.angle_p1_deg;
    row["components"] = t.components;
    row["euler"] = t.euler;
    row["self_intersections"] = m.self_intersections;
    row["closed"] = t.closed();
    row["manifold"] = t.manifold() && t.oriented();
    row["triangles_over"] = nullptr;
    row["rms_over"] = nullptr;
    return row;
}

/// What isotrack made of a frame.
struct Ours {
    Made plain, fitted;
};

/// A method that fails on a level set leaves its row out and says why.
class Frame {
public:
    Frame(int number, const LevelSet& level_set) : number_(number), level_set_(level_set) {}

    std::optional<MeshMetrics> attempt(const std::string& method, const std::function<Made()>& make) try {
        const Made made = make();
        return add(method, measure(made.mesh, level_set_), made.seconds);
    } catch (const std::exception& error) {
        fail(method, error);
        return std::nullopt;
    }
    MeshMetrics add(const std::string& method, const MeshMetrics& metrics, double seconds) {
        rows_.push_back(make_row(number_, method, metrics, seconds));
        return metrics;
    }
    void fail(const std::string& method, const std::exception& error) {
        fmt::print(stderr, "frame {}: {}: {}\n", number_, method, error.what());
        failed_ = true;
    }

    Json& last_row() { return rows_.back(); }
    const std::vector<Json>& rows() const { return rows_; }
    bool failed() const { return failed_; }

private:
    int number_;
    const LevelSet& level_set_;
    std::vector<Json> rows_;
    bool failed_ = false;
};

void run_peers(Frame& frame, const LevelSet& level_set, const Ours& ours, const Arguments& arguments) {
    constexpr int kRepeats = 3;  // of what takes hundredths of a second
    const Made uniform = timed([&] { return volume_to_mesh(level_set, 0.0); }, kRepeats);
    frame.attempt("volumeToMesh 0", [&] { return uniform; });
    frame.attempt("volumeToMesh 0.1",
                  [&] { return timed([&] { return volume_to_mesh(level_set, 0.1); }, kRepeats); });

    const std::size_t count =
        arguments.triangles > 0 ? arguments.triangles : ours.fitted.mesh.triangles.size();
    const auto on_uniform = [&](Made made) {
        made.seconds += uniform.seconds;
        return made;
    };
    const auto decimated = frame.attempt(
        "decimation", [&] { return on_uniform(timed([&] { return decimate(uniform.mesh, count); })); });
    if (arguments.remeshing)
        frame.attempt("isotropic_remeshing",
                      [&] { return on_uniform(remesh_to_count(uniform.mesh, count)); });

    const MeshMetrics plain = measure(ours.plain.mesh, level_set),
                      fitted = measure(ours.fitted.mesh, level_set);
    std::optional<double> plain_over, fitted_over;
    try {
        const ImplicitMesher mesher(level_set, uniform.mesh);
        EqualError equal_error(mesher, level_set);
        const double bound = parse_length(arguments.distance).in_world(level_set.voxel_size());
        const EqualError::Run fixed = equal_error.at(bound);
        frame.add("make_surface_mesh " + arguments.distance, fixed.metrics, fixed.seconds);
        const auto compare = [&](const std::string& name, const MeshMetrics& m, std::optional<double>& over) {
            equal_error.approach(m.error_max());
            const EqualError::Run& run = equal_error.nearest(m.error_max());
            frame.add("make_surface_mesh as " + name, run.metrics, run.seconds);
            if (const auto n = equal_error.triangles(m.error_max()))
                over = static_cast<double>(m.topology.triangles) / *n;
        };
        compare("isotrack", plain, plain_over);
        compare("isotrack --fit", fitted, fitted_over);
    } catch (const std::exception& error) {
        frame.fail("make_surface_mesh", error);
    }

    const auto or_null = [](const std::optional<double>& x) { return x ? Json(*x) : Json(nullptr); };
    frame.add("isotrack", plain, ours.plain.seconds);
    frame.last_row()["triangles_over"] = or_null(plain_over);
    frame.add("isotrack --fit", fitted, ours.fitted.seconds);
    frame.last_row()["triangles_over"] = or_null(fitted_over);
    if (decimated) frame.last_row()["rms_over"] = rms(fitted) / rms(*decimated);
}

int run(const Arguments& arguments) {
    const std::vector<InputFrame> input =
        (arguments.frames.empty() ? find_frames(arguments.inputs)
                                  : find_frames(arguments.inputs, parse_frame_range(arguments.frames)))
            .frames;
    const Length tolerance = parse_length(arguments.tolerance);
    parse_length(arguments.distance);

    std::optional<Tracker> plain, fitted;
    Json rows = Json::array();
    bool failed = false;
    for (std::size_t i = 0; i < input.size(); ++i) {
        const LevelSet level_set = read_level_set(input[i].path, arguments);
        const bool measured = i + arguments.measure >= input.size();
        if (measured && level_set.empty())
            throw InputError(fmt::format("'{}' has no surface to measure on", input[i].path));
        if (!plain && !level_set.empty()) {
            TrackerOptions options;
            options.tolerance = tolerance.in_world(level_set.voxel_size());
            plain.emplace(options);
            options.fit = true;
            fitted.emplace(options);
        }
        if (!plain) continue;
        Ours ours;
        ours.plain = timed([&] { return plain->advance(level_set).mesh; });
        ours.fitted = timed([&] { return fitted->advance(level_set).mesh; });
        if (!measured) continue;
        Frame frame(input[i].number, level_set);
        run_peers(frame, level_set, ours, arguments);
        for (const Json& row : frame.rows()) rows.push_back(row);
        failed = failed || frame.failed();
    }
    const auto format = arguments.json  ? cli::TableFormat::Json
                        : arguments.csv ? cli::TableFormat::Csv
                                        : cli::TableFormat::Text;
    fmt::print("{}", cli::format_table(rows, format));
    return failed ? 3 : 0;
}

}  // namespace
}  // namespace isotrack::bench

int main(int argc, char** argv) {
    isotrack::bench::Arguments arguments;
    CLI::App app{"isotrack and its peers on the same level sets"};
    app.add_option(
           "input", arguments.inputs,
           "VDB files, a folder, or a quoted pattern; isotrack follows them, the last one is measured")
        ->required();
    app.add_option("--frames", arguments.frames, "A:B or A:B:STEP, ends included");
    app.add_option("--measure", arguments.measure, "How many frames are measured: the last ones")
        ->check(CLI::PositiveNumber)
        ->capture_default_str();
    app.add_option("--grid", arguments.grid, "Level-set grid, NAME or NAME[i]");
    app.add_option("--iso", arguments.iso, "Grid value of the surface")->capture_default_str();
    app.add_option("--tolerance", arguments.tolerance, "isotrack's, in voxels (0.5vx) or world units")
        ->capture_default_str();
    app.add_option("--distance", arguments.distance, "make_surface_mesh's distance bound, as the tolerance")
        ->capture_default_str();
    app.add_option("--triangles", arguments.triangles,
                   "For decimation and remeshing; 0: as many as isotrack --fit makes")
        ->capture_default_str();
    app.add_flag("!--no-remeshing", arguments.remeshing,
                 "Without isotropic remeshing, which may not come to an end on meshes with tiny joints");
    auto* csv = app.add_flag("--csv", arguments.csv, "CSV instead of an aligned table");
    app.add_flag("--json", arguments.json, "JSON instead of an aligned table")->excludes(csv);
    try {
        openvdb::initialize();
        app.parse(argc, argv);
        return isotrack::bench::run(arguments);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? 0 : 2;
    } catch (const isotrack::OptionError& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 2;
    } catch (const std::exception& error) {
        fmt::print(stderr, "{}\n", error.what());
        return 1;
    }
}
