// Each stage alone, at growing numbers of particles: time per particle or per triangle, and the quality of
// what it made. Name: stage/surface/particles. `drops` is a level set grid, two drops with a neck; `sphere`
// is the formula itself, whose points all lie on one sphere: the worst case of exact predicates.
#include <benchmark/benchmark.h>
#include <openvdb/openvdb.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "isotrack/delaunay/tetrahedralisation.h"
#include "isotrack/meshing/certify.h"
#include "isotrack/meshing/convection.h"
#include "isotrack/meshing/fit.h"
#include "isotrack/meshing/manifold.h"
#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"
#include "isotrack/sampling/cover.h"
#include "isotrack/sampling/relaxation.h"
#include "isotrack/surface/level_set.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"

namespace isotrack {
namespace {

constexpr double kRadius = 0.4;
constexpr double kVoxelsPerSpacing = 3.0;  // between the two that detail needs and the five of smooth shapes
constexpr int kSweeps = 10;                // of the scene's particles: a mesh as in the middle of a sequence

std::shared_ptr<const Surface> make_surface(const std::string& shape, double voxel) {
    if (shape == "sphere") return shapes::sphere(Vec3::Zero(), kRadius, voxel);
    const auto drops =
        shapes::blended_spheres(-0.25 * Vec3::UnitX(), 0.3, 0.2 * Vec3::UnitX(), 0.25, 0.15, voxel);
    return std::make_shared<LevelSet>(rasterise(*drops, voxel));
}

/// Wanted spacing the same everywhere.
SizingLimits uniform(double spacing) {
    return {0.1 * spacing, 1.0, spacing, spacing, spacing};
}

/// Particles on a surface and what the stages make of them.
struct Scene {
    std::shared_ptr<const Surface> surface;
    SizingLimits limits{};
    Particles seeded, particles;  ///< As covered, and after relaxation.
    Adjacency adjacency;
    Tetrahedra cells;
    CarvedSurface carved;
    TriangleMesh mesh;
    std::optional<CrossingGrid> crossings;
};

Scene make_scene(const std::string& shape, std::size_t count) {
    Scene s;
    double spacing =
        std::sqrt(8.0 * std::acos(-1.0) / (std::sqrt(3.0) * static_cast<double>(count))) * kRadius;
    for (int round = 0; round < 5; ++round) {  // until the count is about right
        s.surface = make_surface(shape, spacing / kVoxelsPerSpacing);
        s.limits = uniform(spacing);
        s.seeded.clear();
        Id next_id = 0;
        cover(s.seeded, *s.surface, CrossingGrid(*s.surface), s.limits, 1, next_id);
        const double ratio = static_cast<double>(s.seeded.size()) / static_cast<double>(count);
        if (ratio > 0.95 && ratio < 1.05) break;
        spacing *= std::sqrt(ratio);
    }
    s.particles = s.seeded;
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
        s.adjacency = vertex_adjacency(tetrahedralise(s.particles.position), s.particles.size());
        relax(s.particles, s.adjacency, *s.surface, 1);
    }
    s.cells = tetrahedralise(s.particles.position);
    s.adjacency = vertex_adjacency(s.cells, s.particles.size());
    s.carved =
        carve(s.cells, guided_convection(s.cells, s.particles.position, s.particles.normal, *s.surface),
              s.particles.position);
    std::size_t midpoint = 0;
    for (const int p : s.carved.particle)
        s.mesh.points.push_back(p >= 0 ? s.particles.position[p] : s.carved.midpoints[midpoint++]);
    s.mesh.triangles = s.carved.triangles;
    s.crossings.emplace(*s.surface);
    return s;
}

/// Made when first asked for, and kept.
const Scene& scene(const std::string& shape, std::size_t count) {
    static std::map<std::pair<std::string, std::size_t>, Scene> scenes;
    const auto key = std::make_pair(shape, count);
    const auto it = scenes.find(key);
    return it != scenes.end() ? it->second : scenes.emplace(key, make_scene(shape, count)).first->second;
}

void count_items(benchmark::State& state, std::size_t items) {
    state.SetItemsProcessed(static_cast<std::int64_t>(items) * state.iterations());
    state.counters["items"] = static_cast<double>(items);
}

/// Root of the mean square distance to the surface over the triangles, voxels.
double rms_voxels(const std::vector<TriangleError>& errors, const Surface& surface) {
    double sum = 0.0;
    for (const TriangleError& e : errors) sum += e.mean_square;
    return std::sqrt(sum / static_cast<double>(errors.size())) / surface.resolution();
}

/// Distance to the nearest neighbour over the spacing that a hexagonal packing would have.
double mean_nearest(const Particles& particles, const Adjacency& adjacency) {
    double sum = 0.0;
    for (std::size_t i = 0; i < particles.size(); ++i) {
        double least = std::numeric_limits<double>::infinity();
        for (const int j : adjacency.of(i))
            least = std::min(least, (particles.position[i] - particles.position[j]).norm());
        sum += least / particles.spacing[i];
    }
    return sum / static_cast<double>(particles.size());
}

/// O1 and O2 from half a voxel off the surface.
void project(benchmark::State& state, const Scene& s) {
    const std::size_t n = s.particles.size();
    const double off = 0.5 * s.surface->resolution();
    std::vector<Vec3> points(n), normals(n);
    for (auto _ : state)
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, n, 128), [&](const auto& range) {
            const auto probe = s.surface->probe();
            for (std::size_t i = range.begin(); i != range.end(); ++i) {
                const Vec3 start = s.particles.position[i] + (i % 2 ? off : -off) * s.particles.normal[i];
                points[i] = probe->project(start).value_or(start);
                normals[i] = probe->normal(points[i]);
            }
        });
    count_items(state, n);
    double worst = 0.0;
    const auto probe = s.surface->probe();
    for (const Vec3& p : points) worst = std::max(worst, std::abs(probe->value(p)));
    state.counters["max_error_vx"] = worst / s.surface->resolution();
}

void cover_all(benchmark::State& state, const Scene& s) {
    Particles particles;
    for (auto _ : state) {
        particles.clear();
        Id next_id = 0;
        cover(particles, *s.surface, CrossingGrid(*s.surface), s.limits, 1, next_id);
    }
    count_items(state, particles.size());
}

void relax_sweep(benchmark::State& state, const Scene& s) {
    const Adjacency adjacency = vertex_adjacency(tetrahedralise(s.seeded.position), s.seeded.size());
    Particles particles;
    for (auto _ : state) {
        state.PauseTiming();
        particles = s.seeded;
        state.ResumeTiming();
        relax(particles, adjacency, *s.surface, 1);
    }
    count_items(state, particles.size());
    state.counters["nearest_before"] = mean_nearest(s.seeded, adjacency);
    state.counters["nearest_after"] = mean_nearest(particles, adjacency);
}

void build_tetrahedra(benchmark::State& state, const Scene& s) {
    std::size_t cells = 0;
    for (auto _ : state) cells = tetrahedralise(s.particles.position).size();
    count_items(state, s.particles.size());
    state.counters["cells"] = static_cast<double>(cells);
}

void label_cells(benchmark::State& state, const Scene& s) {
    for (auto _ : state)
        benchmark::DoNotOptimize(
            guided_convection(s.cells, s.particles.position, s.particles.normal, *s.surface).data());
    count_items(state, s.particles.size());
}

void carve_labels(benchmark::State& state, const Scene& s) {
    const CellLabels labels =
        guided_convection(s.cells, s.particles.position, s.particles.normal, *s.surface);
    CarvedSurface carved;
    for (auto _ : state) carved = carve(s.cells, labels, s.particles.position);
    count_items(state, s.particles.size());
    state.counters["complex_edges"] = static_cast<double>(carved.complex_edges.size());
    const std::vector<double> angles = smallest_angles(s.mesh);
    state.counters["min_angle"] = *std::min_element(angles.begin(), angles.end());
}

/// At 28 points, as certification does.
void errors(benchmark::State& state, const Scene& s) {
    std::vector<TriangleError> result;
    for (auto _ : state) result = triangle_errors(s.mesh.points, s.mesh.triangles, *s.surface, 6);
    count_items(state, s.mesh.triangles.size());
    double worst = 0.0;
    for (const TriangleError& e : result) worst = std::max(worst, e.largest);
    state.counters["max_error_vx"] = worst / s.surface->resolution();
}

void distances(benchmark::State& state, const Scene& s) {
    std::vector<float> result;
    for (auto _ : state)
        result =
            crossing_distances(s.mesh.points, s.mesh.triangles, *s.crossings, 1.5 * s.surface->resolution());
    count_items(state, s.mesh.triangles.size());
    state.counters["crossings"] = static_cast<double>(s.crossings->size());
    state.counters["max_error_vx"] =
        *std::max_element(result.begin(), result.end()) / s.surface->resolution();
}

void fit_vertices(benchmark::State& state, const Scene& s) {
    constexpr int kSteps = 6;
    std::vector<Vec3> vertices;
    for (auto _ : state) {
        state.PauseTiming();
        vertices = s.mesh.points;
        state.ResumeTiming();
        fit(vertices, s.mesh.triangles, *s.surface, kSteps);
    }
    count_items(state, s.mesh.triangles.size());
    const auto rms = [&](const std::vector<Vec3>& points) {
        return rms_voxels(triangle_errors(points, s.mesh.triangles, *s.surface, 6), *s.surface);
    };
    state.counters["rms_before_vx"] = rms(s.mesh.points);
    state.counters["rms_after_vx"] = rms(vertices);
}

void crossing_triangles(benchmark::State& state, const Scene& s) {
    std::size_t pairs = 0;
    for (auto _ : state) pairs = self_intersections(s.mesh).size();
    count_items(state, s.mesh.triangles.size());
    state.counters["pairs"] = static_cast<double>(pairs);
}

void register_stage(const std::string& name, void (*stage)(benchmark::State&, const Scene&)) {
    for (const char* shape : {"drops", "sphere"})
        for (const std::size_t count : {500, 5000, 50000})
            benchmark::RegisterBenchmark((name + '/' + shape + '/' + std::to_string(count)).c_str(),
                                         [=](benchmark::State& state) { stage(state, scene(shape, count)); })
                ->UseRealTime()
                ->Unit(benchmark::kMillisecond);
}

}  // namespace
}  // namespace isotrack

int main(int argc, char** argv) {
    using namespace isotrack;
    openvdb::initialize();
    register_stage("project", project);
    register_stage("cover", cover_all);
    register_stage("relax_sweep", relax_sweep);
    register_stage("tetrahedralise", build_tetrahedra);
    register_stage("guided_convection", label_cells);
    register_stage("carve", carve_labels);
    register_stage("triangle_errors", errors);
    register_stage("crossing_distances", distances);
    register_stage("fit", fit_vertices);
    register_stage("self_intersections", crossing_triangles);
    benchmark::Initialize(&argc, argv);
    if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
    benchmark::RunSpecifiedBenchmarks();
    return 0;
}
