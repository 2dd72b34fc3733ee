// run.json: what a run did, one row per frame.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace isotrack {

/// One frame. Counts and measures are those of the mesh that was written. Seconds are wall-clock.
struct FrameReport {
    int frame = 0;
    double time = 0.0;  ///< Seconds since the first frame with a rate, else the frame number.
    std::string input, grid, output;
    double voxel_size = 0.0;
    std::size_t active_voxels = 0, particles = 0, vertices = 0, triangles = 0, components = 0;
    long euler = 0;
    std::optional<long> surface_euler;  ///< Of the level set's lattice, joined as volumeToMesh does; see
                                        ///< `Surface::lattice_euler`. Where it is another: `message`.
    std::size_t born = 0, died = 0;  ///< Particles of this frame that were not in the last, and the reverse.
    std::size_t seeded = 0,
                lost = 0;  ///< Of the born, seeded on uncovered surface; of the died, those the carry lost.
    int sweeps = 0;
    std::string delaunay_strategy;
    std::size_t relocated = 0;  ///< Vertices the tetrahedralisation moved one by one; 0 when it was rebuilt.
    double max_error_vx = 0.0, rms_error_vx = 0.0;  ///< Both ways, in voxels.
    double most_turned_deg = 0.0;                   ///< Between a triangle and the level set's normals.
    double min_angle_deg = 0.0;
    bool closed = true, manifold = true;
    bool opened = false;             ///< A cap was left out on purpose: the mesh is not closed there.
    std::size_t lost_crossings = 0;  ///< Grid edges that cross surface which the mesh does not hold.
    std::size_t self_intersections = 0;
    std::map<std::string, double>
        seconds;  ///< read, open, carry, cover, size, relax, delaunay, convect, certify, fit, write, total.
    double peak_memory_mb = 0.0;
    std::string status = "ok";  ///< "ok", "empty", "skipped", "failed", "tolerance_not_met".
    std::string message;

    /// By the Euler number: the mesh has components or handles that the level set does not have, or lacks
    /// some. Of two such faults one may hide the other.
    bool has_other_topology() const { return surface_euler && !opened && euler != *surface_euler; }
};

struct RunReport {
    std::string command_line, version;
    std::map<std::string, std::string> settings;  ///< Effective values, lengths with their unit.
    std::vector<FrameReport> frames;
};

/// Writes by a temporary name and a rename. \throws IoError.
void write_run_report(const RunReport& report, const std::string& path);

/// The row as one JSON object, the form it has in run.json.
std::string to_json(const FrameReport& row);

}  // namespace isotrack
