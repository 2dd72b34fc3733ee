#include "isotrack/io/run_report.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <ostream>

#include "io/atomic_file.h"

namespace isotrack {
namespace {

using Json = nlohmann::ordered_json;

/// JSON has no NaN and no infinity.
Json number(double value) {
    return std::isfinite(value) ? Json(value) : Json(nullptr);
}

Json to_object(const FrameReport& row) {
    Json seconds = Json::object();
    for (const auto& [stage, time] : row.seconds) seconds[stage] = number(time);
    return {{"frame", row.frame},
            {"time", number(row.time)},
            {"input", row.input},
            {"grid", row.grid},
            {"output", row.output},
            {"voxel_size", number(row.voxel_size)},
            {"active_voxels", row.active_voxels},
            {"particles", row.particles},
            {"vertices", row.vertices},
            {"triangles", row.triangles},
            {"components", row.components},
            {"euler", row.euler},
            {"surface_euler", row.surface_euler ? Json(*row.surface_euler) : Json(nullptr)},
            {"born", row.born},
            {"died", row.died},
            {"seeded", row.seeded},
            {"lost", row.lost},
            {"sweeps", row.sweeps},
            {"delaunay_strategy", row.delaunay_strategy},
            {"relocated", row.relocated},
            {"max_error_vx", number(row.max_error_vx)},
            {"rms_error_vx", number(row.rms_error_vx)},
            {"most_turned_deg", number(row.most_turned_deg)},
            {"min_angle_deg", number(row.min_angle_deg)},
            {"closed", row.closed},
            {"manifold", row.manifold},
            {"opened", row.opened},
            {"lost_crossings", row.lost_crossings},
            {"self_intersections", row.self_intersections},
            {"seconds", seconds},
            {"peak_memory_mb", number(row.peak_memory_mb)},
            {"status", row.status},
            {"message", row.message}};
}

/// Paths and messages need not be UTF-8; a report must come out all the same.
std::string dump(const Json& json, int indent) {
    return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

void write_run_report(const RunReport& report, const std::string& path) {
    Json settings = Json::object();
    for (const auto& [name, value] : report.settings) settings[name] = value;
    Json frames = Json::array();
    for (const FrameReport& row : report.frames) frames.push_back(to_object(row));
    const Json json = {{"command_line", report.command_line},
                       {"version", report.version},
                       {"settings", settings},
                       {"frames", frames}};
    write_atomically(path, [&](std::ostream& out) { out << dump(json, 1) << '\n'; });
}

std::string to_json(const FrameReport& row) {
    return dump(to_object(row), -1);
}

}  // namespace isotrack
