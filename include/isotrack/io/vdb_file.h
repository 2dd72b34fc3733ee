// Grids out of VDB files, with a guard in front of OpenVDB.
#pragma once

#include <openvdb/openvdb.h>

#include <optional>
#include <string>
#include <vector>

namespace isotrack {

/// What a file says of a grid, without reading its voxels.
struct GridInfo {
    std::string name;                          ///< May be empty.
    int index = 0;                             ///< Among the grids of the same name: 0 for the first.
    std::string type;                          ///< "float", "double", "vec3s", "points", ...
    std::string grid_class;                    ///< "level set", "fog volume", "staggered", "unknown".
    bool half = false;                         ///< Stored as half floats.
    std::optional<std::size_t> active_voxels;  ///< When the file's metadata states it.
    std::string transform;  ///< "uniform", "scale", "translation", "rotation", "affine", "frustum"; empty if
                            ///< unreadable.
    double voxel_size = 0.0;  ///< Cube root of a voxel's volume; 0 if unknown or not the same everywhere.

    /// `name`, or `name[index]` when the name is empty or not the only one of its kind; without control
    /// characters.
    std::string label;
};

/// Checks that `path` can safely be given to OpenVDB: there, a regular file, the magic number, header,
/// metadata and grid descriptors whose lengths stay within the file, grids whose end lies within the file.
/// Costs a few reads, allocates about what the head of the file needs, whatever lengths it states. OpenVDB
/// need not be initialised by the caller, here and below. \throws IoError with one line: path, what is wrong,
/// what it may be (Git LFS pointer, truncated copy, ...).
void check_vdb_file(const std::string& path);

/// The grids of a file in its order, voxels unread (except in files written as a stream, which have no
/// directory: there the list ends after the first grid that cannot be read). Does what `check_vdb_file` does.
/// A grid that OpenVDB cannot read is listed all the same. \throws IoError.
std::vector<GridInfo> list_grids(const std::string& path);

/// Which grid a user means. `wanted`: NAME or NAME[i] ("[1]" for the second unnamed one). Without it: the
/// only grid of class level set; else the one called surface, phi, sdf, levelset or distance (any case, in
/// this order); else, when no grid has class level set, the only one. Only float and double grids count.
/// \throws InputError that names the file and lists the candidates.
GridInfo choose_grid(const std::vector<GridInfo>& grids, const std::optional<std::string>& wanted,
                     const std::string& path);

/// The velocity grid a user means; without `wanted` a vec3 grid called v, vel or velocity; nullopt when there
/// is none. \throws InputError when `wanted` is not there or is no vec3 grid.
std::optional<GridInfo> choose_velocity_grid(const std::vector<GridInfo>& grids,
                                             const std::optional<std::string>& wanted,
                                             const std::string& path);

/// Reads this one grid of floats, doubles or vec3s and no other, into memory: what happens to the file later
/// does no harm. Each part of the tree is checked before OpenVDB sees it; grids of other types, which nothing
/// here can use, are refused. \throws IoError (message clamped to one line of at most 300 characters).
openvdb::GridBase::Ptr read_grid(const std::string& path, const GridInfo& grid);

}  // namespace isotrack
