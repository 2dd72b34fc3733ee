#include "tracking/frame_work.h"

#include <algorithm>
#include <utility>

#include "isotrack/meshing/blunting.h"
#include "tracking/failing.h"
#include "tracking/stage_timer.h"

namespace isotrack {
namespace {

constexpr int kBluntRounds = 3, kBluntPasses = 12;

}  // namespace

/// Makes sharp triangles blunter. The particles stay where they are: the next frame's triangles are others.
void FrameWork::blunt() {
    const StageTimer timer(frame.seconds, "blunt");
    mesh.carved.midpoints = std::vector<Vec3>();  // of no more use
    std::vector<const CrossingGrid*> reached = inspector->reached();
    std::vector<float> farthest_before;  // of each triangle
    farthest_before.reserve(inspection.errors->size());
    for (const FacetError& error : *inspection.errors) farthest_before.push_back(error.largest);
    Blunter blunter(mesh.vertices, mesh.carved.triangles,
                    lone_flags(mesh, lone_vertices(mesh, frame.particles)), surface, reached,
                    kChangedShare * limits.tolerance, limits.detail);
    // Where changed triangles are beyond the tolerance and farther off than those they stand for, and what is
    // missed that was not before.
    const auto spoilt = [&](bool look_between) {
        inspection = {};  // first: there are many errors
        inspection = inspector->inspect_both_ways(mesh);
        if (look_between) {
            inspector->look_between(mesh, inspection);
            reached = inspector->reached();
        }
        std::vector<Vec3> places;
        for (const Blunting& change : blunter.changes()) {
            double limit = kCertified * limits.tolerance;
            for (const int t : change.triangle) limit = std::max<double>(limit, farthest_before[t]);
            for (const int t : change.triangle)
                if (const FacetError& error = (*inspection.errors)[t]; error.largest > limit)
                    places.push_back(error.where.cast<double>());
        }
        if (inspection.missed.empty()) return places;
        const auto& [vertices, triangles] = blunter.before();
        for (const auto& c : inspector->newly_missed(inspection, vertices, triangles))
            places.push_back(c.point);
        return places;
    };
    bool again = true;
    for (int round = 0; again && round < kBluntRounds && blunter.run(kBluntPasses); ++round) {
        again = false;
        for (auto places = spoilt(true); !places.empty() && blunter.undo_near(places, limits.tolerance);
             places = spoilt(false))
            again = true;
    }
    if (again) inspector->look_between(mesh, inspection);  // where something was taken back last
}

TrackedFrame FrameWork::finish(const TrackerOptions& options) {
    if (options.method != Method::Paper) blunt();
    report(mesh, inspection, surface, frame);
    frame.mesh.points = std::move(mesh.vertices);
    frame.mesh.triangles = std::move(mesh.carved.triangles);
    return std::move(frame);
}

}  // namespace isotrack
