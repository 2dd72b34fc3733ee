// isotrack check: is a mesh what the other programs expect?
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "cli/commands.h"
#include "cli/table.h"
#include "isotrack/error.h"
#include "isotrack/io/mesh_file.h"
#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"

namespace isotrack::cli {
namespace {

struct CheckArguments {
    std::vector<std::string> meshes;
    bool json = false;
};

/// What is wrong with the mesh, in words; empty when nothing is.
std::string list_problems(const MeshTopology& t, std::size_t crossing_pairs, double volume) {
    std::string problems;
    const auto add = [&](std::size_t count, const char* what) {
        if (count > 0) problems += fmt::format("{}{} {}", problems.empty() ? "" : ", ", count, what);
    };
    add(t.border_edges, "border edges");
    add(t.complex_edges, "edges of three or more triangles");
    add(t.pinched_vertices, "vertices with several fans");
    add(t.degenerate_triangles, "triangles with a vertex twice");
    add(t.flipped_edges, "edges between opposite orientations");
    add(crossing_pairs, "crossing pairs of triangles");
    add(t.unused_vertices, "unused vertices");
    if (t.closed() && t.oriented() && volume < 0.0)
        problems += (problems.empty() ? "" : ", ") + std::string("inside out");
    return problems;
}

nlohmann::ordered_json check(const std::string& path) {
    const TriangleMesh mesh = read_mesh(path);
    const MeshTopology t = mesh_topology(mesh);
    const std::size_t crossing_pairs = self_intersections(mesh).size();
    const double volume = enclosed_volume(mesh);
    const bool surface = t.closed() && t.manifold() && t.oriented();
    std::vector<double> angles = smallest_angles(mesh);
    std::sort(angles.begin(), angles.end());

    nlohmann::ordered_json row;
    row["file"] = path;
    row["vertices"] = t.vertices;
    row["triangles"] = t.triangles;
    row["components"] = t.components;
    row["genus"] = nullptr;
    if (surface) row["genus"] = t.genus();
    row["closed"] = t.closed();
    row["manifold"] = t.manifold();
    row["oriented"] = t.oriented();
    row["self_intersections"] = crossing_pairs;
    row["unused_vertices"] = t.unused_vertices;
    row["min_angle_deg"] = nullptr;
    row["angle_p1_deg"] = nullptr;
    if (!angles.empty()) {
        row["min_angle_deg"] = angles.front();
        row["angle_p1_deg"] = angles[angles.size() / 100];
    }
    row["volume"] = volume;
    row["problems"] = list_problems(t, crossing_pairs, volume);
    return row;
}

int run(const CheckArguments& arguments) {
    auto rows = nlohmann::ordered_json::array();
    bool unreadable = false, unsound = false;
    for (const std::string& path : arguments.meshes) try {
            rows.push_back(check(path));
            unsound = unsound || rows.back()["problems"] != "";
        } catch (const IoError& error) {
            spdlog::error("{}", error.what());
            unreadable = true;
        } catch (const InputError& error) {
            spdlog::error("{}: {}", path, error.what());
            unsound = true;
        }
    fmt::print("{}", format_table(rows, arguments.json ? TableFormat::Json : TableFormat::Text));
    return unreadable ? 1 : unsound ? 3 : 0;
}

}  // namespace

void add_check_command(CLI::App& app, int& result) {
    auto arguments = std::make_shared<CheckArguments>();
    CLI::App* check = app.add_subcommand(
        "check", "Tell whether meshes are closed, manifold, oriented outward and free of self-intersections");
    check->add_option("mesh", arguments->meshes, "Mesh files: .ply .obj .off .stl")->required();
    check->add_flag("--json", arguments->json, "JSON on stdout instead of a table");
    check->footer("Exit code: 0 all sound, 3 a mesh has a problem, 1 a file cannot be read.");
    check->callback([arguments, &result] { result = run(*arguments); });
}

}  // namespace isotrack::cli
