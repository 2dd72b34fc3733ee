// A look at the voxels of a VDB grid before OpenVDB reads them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace isotrack {

/// How the values of a grid are stored.
struct VdbValueLayout {
    std::size_t value_bytes;    ///< Of one value as such: tiles, background.
    std::size_t stored_bytes;   ///< Of one value in a node's buffer: less than `value_bytes` for half floats.
    bool half;                  ///< Stored as half floats.
    std::uint32_t compression;  ///< OpenVDB's flags.
};

/// Walks the tree (of the usual shape 5, 4, 3; file version 222 or later) that begins at `bytes[begin]`,
/// without decompressing it, and checks what OpenVDB 10 does not: it copies a block that says it is stored as
/// it is into a buffer of the expected size, whatever length the block states, and it trusts the lengths
/// inside a Blosc block. Returns where the tree ends. \throws std::runtime_error with what is wrong.
std::size_t check_vdb_tree(std::string_view bytes, std::size_t begin, const VdbValueLayout& layout);

}  // namespace isotrack
