// The main job: frames of VDB files in, mesh files out. Reads ahead and writes behind.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "isotrack/io/run_report.h"
#include "isotrack/io/sequence.h"
#include "isotrack/tracking/tracker.h"

namespace isotrack {

/// A length as users give it: world units, or voxels of the first frame that has a surface.
struct Length {
    double value = 0.0;
    bool in_voxels = false;
    double in_world(double voxel_size) const { return in_voxels ? value * voxel_size : value; }
};

/// "0.5vx" or "0.01"; must be positive and finite. \throws OptionError.
Length parse_length(const std::string& text);
std::string to_string(const Length& length);

enum class OnError { Skip, Stop };  ///< After a frame that cannot be used: go on, or end the run there.
enum class OnMissing {
    Skip,
    Stop
};  ///< A gap in the frame numbers: go on with a note, or refuse before the work.
enum class OnExisting { Refuse, Overwrite, Skip };

struct MeshSequenceOptions {
    Length tolerance{0.5, true};
    std::optional<double> angle_deg;
    std::optional<Length> min_edge, max_edge;
    Method method = Method::Tolerance;
    Reconstruction reconstruction = Reconstruction::Guided;
    Border border = Border::Close;
    UpdateStrategy delaunay = UpdateStrategy::Auto;
    bool fit = false;
    std::uint64_t seed = 1;
    /// NAME or NAME[i]; unset: chosen by `choose_grid` and `choose_velocity_grid`. Points are carried by the
    /// velocities of a frame and, if it has some, of the next.
    std::optional<std::string> grid, velocity_grid;
    double iso = 0.0;
    /// > 0. Set: velocities, read and written, are per second. Unset: per frame.
    std::optional<double> fps;
    OnError on_error = OnError::Skip;
    OnMissing on_missing = OnMissing::Skip;
    OnExisting on_existing = OnExisting::Refuse;
};

/// Called from the thread that runs the sequence.
struct MeshSequenceEvents {
    std::function<void(const RunReport&)>
        started;  ///< Once, when the first usable frame has fixed the effective settings.
    std::function<void(const FrameReport&)>
        finished;  ///< After each frame, in order, when its file is in place.
};

/// Tracks `input` and writes one mesh per frame to `output` (a pattern with a number field, or a plain path
/// for a single frame). While a frame is tracked the last one is written and then the next one read, so that
/// there are two grids at once. A frame that cannot be used becomes a row with status "failed" and its cause;
/// the frames after it are tracked on from the last good one. The report holds a row for every input frame
/// that was reached. \throws OptionError before any work: bad option, unknown extension, output without a
/// number field, outputs that exist, or gaps where they are not allowed.
RunReport mesh_sequence(const InputSequence& input, const std::string& output,
                        const MeshSequenceOptions& options, const MeshSequenceEvents& events = {});

/// 0: every row is good; 1: no frame came through; 3: some frames failed or missed their checks.
int exit_code(const RunReport& report);

}  // namespace isotrack
