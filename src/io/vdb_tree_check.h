// A look at the voxels of a VDB grid before OpenVDB reads them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

namespace isotrack {

/// How the values of a grid are stored.
struct VdbValueLayout {
    std::size_t value_bytes;    ///< Of one value as such: tiles, background.
    std::size_t stored_bytes;   ///< Of one value in a node's buffer: less than `value_bytes` for half floats.
    bool half;                  ///< Stored as half floats.
    std::uint32_t compression;  ///< OpenVDB's flags.
};

/// Where a tree is in its bytes.
struct VdbTreeExtent {
    std::size_t end;
    /// Where the buffer of each begins, with its mask once more, in the order of the tree.
    std::vector<std::size_t> leaves;
};

/// Walks the tree (of the usual shape 5, 4, 3; file version 222 or later) that `bytes` begin with,
/// without decompressing it, and checks what OpenVDB 10 does not: it copies a block that says it is stored as
/// it is into a buffer of the expected size, whatever length the block states, and it trusts the lengths
/// inside a Blosc block. \throws std::runtime_error with what is wrong.
VdbTreeExtent check_vdb_tree(std::string_view bytes, const VdbValueLayout& layout);

}  // namespace isotrack
