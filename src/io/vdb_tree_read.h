// The tree of a VDB grid, from bytes that are checked.
#pragma once

#include <openvdb/openvdb.h>

#include <cstdint>

#include "io/vdb_tree_walk.h"

namespace isotrack {

/// What the file says of how its trees are written.
struct VdbTreeFormat {
    openvdb::VersionId openvdb_version;
    std::uint32_t file_version;
    std::uint32_t compression;  ///< OpenVDB's flags.
};

/// Reads the tree, of float, double or vectors of three of them, that `walk` is at the beginning of, into
/// `grid`, whose class and metadata are set. The values of leaves are read by several threads of TBB, into
/// memory that this thread allocates. \throws std::runtime_error when it is of another type or has other
/// leaves, what the walk does, and what OpenVDB does, from any thread.
void read_vdb_tree(openvdb::GridBase& grid, VdbTreeWalk& walk, const VdbTreeFormat& format);

}  // namespace isotrack
