// A frame in the making, and what is left to do of it when its particles are final.
#pragma once

#include <optional>
#include <vector>

#include "isotrack/sampling/sizing.h"
#include "isotrack/surface/crossing_grid.h"
#include "isotrack/surface/surface.h"
#include "isotrack/tracking/tracker.h"
#include "tracking/inspection.h"

namespace isotrack {

struct FrameWork {
    const Surface& surface;
    const SizingLimits limits;
    TrackedFrame frame;
    FrameMesh mesh;
    std::optional<CrossingGrid> crossings;
    std::optional<Inspector> inspector;  ///< Of the meshes of this frame.
    Inspection inspection;
    bool follows = false;  ///< Most particles are of the frame before; else they are sampled anew.

    /// Makes the triangles better as far as the mesh goes on reaching all it reached and none gets beyond the
    /// tolerance, and hands the frame over. Needs nothing of the tracker, which may be at the next frames.
    TrackedFrame finish(const TrackerOptions& options);

private:
    void blunt();
};

}  // namespace isotrack
