#include "isotrack/io/run_report.h"

#include <gtest/gtest.h>

#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

#include "isotrack/error.h"
#include "support/temp_folder.h"

namespace isotrack {
namespace {

using nlohmann::ordered_json;

FrameReport some_row() {
    FrameReport row;
    row.frame = 7;
    row.time = 0.25;
    row.input = "in \"quoted\".vdb";
    row.grid = "phi";
    row.triangles = 123456789012;
    row.euler = -4;
    row.surface_euler = 2;
    row.seconds = {{"read", 0.5}, {"total", 1.5}};
    row.closed = false;
    row.status = "failed";
    row.message = "two\nlines";
    return row;
}

TEST(RunReport, GivesEveryFieldOfARowInOrder) {
    const ordered_json row = ordered_json::parse(to_json(some_row()));
    std::vector<std::string> names;
    for (const auto& item : row.items()) names.push_back(item.key());
    EXPECT_EQ(names, (std::vector<std::string>{"frame",
                                               "time",
                                               "input",
                                               "grid",
                                               "output",
                                               "voxel_size",
                                               "active_voxels",
                                               "particles",
                                               "vertices",
                                               "triangles",
                                               "components",
                                               "euler",
                                               "surface_euler",
                                               "born",
                                               "died",
                                               "seeded",
                                               "lost",
                                               "sweeps",
                                               "delaunay_strategy",
                                               "relocated",
                                               "max_error_vx",
                                               "rms_error_vx",
                                               "most_turned_deg",
                                               "min_angle_deg",
                                               "closed",
                                               "manifold",
                                               "opened",
                                               "lost_crossings",
                                               "self_intersections",
                                               "seconds",
                                               "peak_memory_mb",
                                               "status",
                                               "message"}));
    EXPECT_EQ(row["frame"], 7);
    EXPECT_EQ(row["time"], 0.25);
    EXPECT_EQ(row["input"], "in \"quoted\".vdb");
    EXPECT_EQ(row["triangles"], 123456789012);
    EXPECT_EQ(row["euler"], -4);
    EXPECT_EQ(row["surface_euler"], 2);
    EXPECT_EQ(row["seconds"]["total"], 1.5);
    EXPECT_EQ(row["closed"], false);
    EXPECT_EQ(row["manifold"], true);
    EXPECT_EQ(row["message"], "two\nlines");
    EXPECT_EQ(to_json(some_row()).find('\n'), std::string::npos);
}

TEST(RunReport, WritesNullForWhatIsNoNumber) {
    FrameReport row;
    row.max_error_vx = std::numeric_limits<double>::quiet_NaN();
    row.rms_error_vx = std::numeric_limits<double>::infinity();
    row.seconds["total"] = -std::numeric_limits<double>::infinity();
    const ordered_json json = ordered_json::parse(to_json(row));
    EXPECT_TRUE(json["max_error_vx"].is_null());
    EXPECT_TRUE(json["rms_error_vx"].is_null());
    EXPECT_TRUE(json["seconds"]["total"].is_null());
    EXPECT_TRUE(json["surface_euler"].is_null());
}

TEST(RunReport, TellsAnotherTopology) {
    FrameReport row;
    row.euler = 2;
    EXPECT_FALSE(row.has_other_topology()) << "that of the surface is not known";
    row.surface_euler = 2;
    EXPECT_FALSE(row.has_other_topology());
    row.surface_euler = 0;
    EXPECT_TRUE(row.has_other_topology());
    row.opened = true;
    EXPECT_FALSE(row.has_other_topology()) << "the mesh has a border, the surface none";
}

TEST(RunReport, SurvivesTextThatIsNotUtf8) {
    FrameReport row;
    row.input = "caf\xe9.vdb";
    EXPECT_NO_THROW(ordered_json::parse(to_json(row)));
}

TEST(RunReport, WritesTheWholeReport) {
    const support::TempFolder temp;
    RunReport report;
    report.command_line = "isotrack mesh a.vdb";
    report.version = "1.2.3";
    report.settings = {{"tolerance", "0.5vx"}};
    report.frames = {some_row(), FrameReport{}};
    write_run_report(RunReport{}, temp.file("run.json"));
    write_run_report(report, temp.file("run.json"));  // replaces
    std::ifstream in(temp.file("run.json"));
    const ordered_json json = ordered_json::parse(in);
    EXPECT_EQ(json["command_line"], "isotrack mesh a.vdb");
    EXPECT_EQ(json["version"], "1.2.3");
    EXPECT_EQ(json["settings"]["tolerance"], "0.5vx");
    ASSERT_EQ(json["frames"].size(), 2u);
    EXPECT_EQ(json["frames"][0].dump(), to_json(some_row()));
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(temp.path()), {}), 1)
        << "a temporary file is left";
}

TEST(RunReport, SaysWhyItCannotBeWritten) {
    const support::TempFolder temp;
    try {
        write_run_report(RunReport{}, temp.file("nowhere/run.json"));
        FAIL() << "was not refused";
    } catch (const IoError& error) {
        EXPECT_NE(std::string(error.what()).find("nowhere/run.json"), std::string::npos);
        EXPECT_NE(std::string(error.what()).find("No such file"), std::string::npos);
    }
    EXPECT_THROW(write_run_report(RunReport{}, temp.path().string()), IoError);
    EXPECT_TRUE(std::filesystem::is_empty(temp.path()));
}

}  // namespace
}  // namespace isotrack
