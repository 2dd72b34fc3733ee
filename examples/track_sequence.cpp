// Follows a sequence of VDB level sets and tells how far its surface moved, by the particles that live on
// from frame to frame. Writes the mesh of every frame, with ids and velocities.
//
//     track_sequence 'data/blobs/blobs.####.vdb' 'out/blobs.####.ply'
#include <isotrack/io/mesh_file.h>
#include <isotrack/io/sequence.h>
#include <isotrack/io/vdb_file.h>
#include <isotrack/surface/level_set.h>
#include <isotrack/tracking/tracker.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <optional>
#include <string>
#include <unordered_map>

using namespace isotrack;

namespace {

using Places = std::unordered_map<Id, Vec3>;

Places places_by_id(const Particles& particles) {
    Places places;
    for (std::size_t i = 0; i < particles.size(); ++i) places.emplace(particles.id[i], particles.position[i]);
    return places;
}

void print_motion(const Places& before, const Places& now) {
    std::size_t survivors = 0;
    double sum = 0.0, longest = 0.0;
    for (const auto& [id, place] : now) {
        const auto old = before.find(id);
        if (old == before.end()) continue;  // born in this frame
        const double way = (place - old->second).norm();
        ++survivors;
        sum += way;
        longest = std::max(longest, way);
    }
    if (survivors > 0)
        std::printf("  %zu ids live on; they moved %.4f on average, %.4f at most", survivors,
                    sum / static_cast<double>(survivors), longest);
}

void track(const std::string& input, const std::string& output) {
    const std::filesystem::path folder = std::filesystem::path(output).parent_path();
    if (!folder.empty()) std::filesystem::create_directories(folder);

    std::optional<Tracker> tracker;
    Places before;
    for (const InputFrame& frame : find_frames({input}).frames) {
        const GridInfo grid = choose_grid(list_grids(frame.path), std::nullopt, frame.path);
        const LevelSet level_set(read_grid(frame.path, grid));
        if (!tracker) {
            TrackerOptions options;
            options.tolerance = 0.5 * level_set.voxel_size();
            tracker.emplace(options);
        }

        const TrackedFrame result = tracker->advance(level_set);
        write_mesh(result.mesh, expand_pattern(output, frame.number));

        const Places now = places_by_id(tracker->particles());
        std::printf("frame %d: %zu triangles, error %.2f voxels", frame.number, result.mesh.triangles.size(),
                    result.max_error / level_set.voxel_size());
        print_motion(before, now);
        std::printf("\n");
        before = now;
    }
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 3) {
        std::fprintf(stderr, "usage: track_sequence FRAMES.####.vdb MESHES.####.ply\n");
        return 2;
    }
    try {
        openvdb::initialize();
        track(argv[1], argv[2]);
    } catch (const std::exception& error) {
        std::fprintf(stderr, "%s\n", error.what());
        return EXIT_FAILURE;
    }
    return EXIT_SUCCESS;
}
