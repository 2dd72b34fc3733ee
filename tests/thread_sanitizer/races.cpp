// Builds a DT by four threads, then tracks two drops that merge and then jump apart, plain and with fit, for
// the thread sanitizer to watch: it ends the program at the first race. Without it these are two more tests.
#include <openvdb/openvdb.h>
#include <tbb/global_control.h>

#include <cmath>
#include <cstdio>
#include <vector>

#include "isotrack/delaunay/tetrahedralisation.h"
#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/surface/level_set.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"
#include "isotrack/tracking/tracker.h"

namespace isotrack {
namespace {

/// Of points on a wavy ball, where many cells span it and threads often meet, and on a cube of a lattice,
/// where they must look behind the hull.
bool is_same_by_four_threads() {
    constexpr int kTimes = 10;  // no two of which go alike
    std::vector<Vec3> wavy, lattice;
    for (int i = 0; i < 4000; ++i) {
        const double z = 1.0 - (i + 0.5) / 2000.0, r = std::sqrt(1.0 - z * z), angle = 2.4 * i;
        const Vec3 p(r * std::cos(angle), r * std::sin(angle), z);
        wavy.push_back((1.0 + 0.1 * std::sin(7.0 * p.x()) * std::sin(5.0 * p.y())) * p);
    }
    for (int i = 0; i < 16 * 16 * 16; ++i) lattice.emplace_back(i / 256, i / 16 % 16, i % 16);
    for (const std::vector<Vec3>& points : {wavy, lattice}) {
        const auto by_four = make_tetrahedralisation(UpdateStrategy::Rebuild),
                   alone = make_tetrahedralisation(UpdateStrategy::Rebuild);
        alone->assign(points, 1);
        for (int again = 0; again < kTimes; ++again) {
            by_four->assign(points, 4);
            if (by_four->cells().links != alone->cells().links) return false;
        }
        std::printf("%zu cells\n", alone->cells().size());
    }
    return true;
}

}  // namespace
}  // namespace isotrack

int main() {
    using namespace isotrack;
    constexpr double kVoxel = 0.08;
    openvdb::initialize();
    // What OpenVDB's own library still gives to TBB's is not instrumented and must stay on this thread; our
    // loops, and those of OpenVDB's headers, run on four of their own.
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);

    if (!is_same_by_four_threads()) {
        std::fprintf(stderr, "the DT is another by four threads\n");
        return 1;
    }
    for (const bool fit : {false, true}) {
        TrackerOptions options;
        options.tolerance = 0.5 * kVoxel;
        options.fit = fit;
        LevelSetOptions level;
        if (fit) level.iso = 0.1 * kVoxel;  // not zero: the grid is copied and converted
        Tracker tracker(options);
        for (const double half_distance : {0.66, 0.6, 0.55, 1.1}) {
            const auto drops = shapes::blended_spheres({-half_distance, 0, 0}, 0.5, {half_distance, 0, 0},
                                                       0.5, 0.15, kVoxel);
            const LevelSet surface(rasterise(*drops, kVoxel), level);
            const TrackedFrame frame = tracker.advance(surface, [](const Vec3& p) { return p; });
            const MeshTopology topology = mesh_topology(frame.mesh);
            std::printf("%s, half distance %.2f: %zu triangles, %zu components\n", fit ? "fit" : "plain",
                        half_distance, frame.mesh.triangles.size(), topology.components);
            if (!topology.closed() || !topology.manifold() || !(enclosed_volume(frame.mesh) > 0.0)) {
                std::fprintf(stderr, "that is no closed manifold mesh around a volume\n");
                return 1;
            }
        }
    }
    return 0;
}
