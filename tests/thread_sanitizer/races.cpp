// Tracks two drops that merge and then jump apart, plain and with fit, for the thread sanitizer to watch: it
// ends the program at the first race. Without it this is one more test of the tracker.
#include <openvdb/openvdb.h>
#include <tbb/global_control.h>

#include <cstdio>

#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/surface/level_set.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"
#include "isotrack/tracking/tracker.h"

int main() {
    using namespace isotrack;
    constexpr double kVoxel = 0.08;
    openvdb::initialize();
    // What OpenVDB's own library still gives to TBB's is not instrumented and must stay on this thread; our
    // loops, and those of OpenVDB's headers, run on four of their own.
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);

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
