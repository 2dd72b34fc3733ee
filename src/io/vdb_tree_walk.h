// A look at the voxels of a VDB grid before OpenVDB reads them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string_view>
#include <vector>

#include "io/system_memory.h"

namespace isotrack {

/// How the values of a grid are stored.
struct VdbValueLayout {
    std::size_t value_bytes;    ///< Of one value as such: tiles, background.
    std::size_t stored_bytes;   ///< Of one value in a node's buffer: less than `value_bytes` for half floats.
    bool half;                  ///< Stored as half floats.
    std::uint32_t compression;  ///< OpenVDB's flags.
};

/// Walks a tree (of the usual shape 5, 4, 3; file version 222 or later) from its beginning, without
/// decompressing it, and checks what OpenVDB 10 does not: it copies a block that says it is stored as it is
/// into a buffer of the expected size, whatever length the block states, and it trusts the lengths inside a
/// Blosc block. Part by part: but for the topology there are never all of its bytes at once.
///
/// All throw std::runtime_error with what is wrong, std::bad_alloc, and what `read` throws.
class VdbTreeWalk {
public:
    /// Writes the next bytes, so many, to a place. It is asked ahead of the walk, also for what is behind the
    /// tree.
    using Read = std::function<void(char*, std::size_t)>;

    /// Of the next `size` bytes that `read` has the tree takes the first.
    VdbTreeWalk(std::uint64_t size, const VdbValueLayout& layout, Read read);

    /// What comes before the buffers of the leaves. Once, at first; valid until the next call.
    std::string_view topology();
    std::size_t leaf_count() const { return active_.size(); }

    /// The buffers of some leaves that follow each other in the order of the tree.
    struct Buffers {
        std::string_view bytes;
        std::vector<std::size_t> begin;  ///< In `bytes`, of each, with its mask once more.
    };
    /// Of those that come next, none when there are no more; valid until the next call.
    Buffers next_buffers();

    /// So many bytes have been walked.
    std::uint64_t position() const { return given_up_ + at_; }

private:
    std::string_view take(std::uint64_t count);
    template <typename T>
    T take_number();
    void read_root();
    void read_internal(int log2_dim);
    void skip_values(std::size_t count, std::size_t active);
    void skip_block(std::size_t count);
    void give_up_walked();

    Read read_;
    std::uint64_t unread_;        // bytes
    std::uint64_t given_up_ = 0;  // bytes, before those here
    SystemMemory here_;           // of which `filled_` bytes have been read, and `at_` walked
    std::size_t filled_ = 0, at_ = 0;
    VdbValueLayout layout_;
    std::vector<std::size_t> active_;  // voxels of each leaf, in the order of their buffers
    std::size_t next_leaf_ = 0;
};

}  // namespace isotrack
