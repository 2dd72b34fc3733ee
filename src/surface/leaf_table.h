// The leaves of a tree by where they are.
#pragma once

#include <openvdb/openvdb.h>

#include <atomic>
#include <cstdint>
#include <vector>

namespace isotrack {

/// Where the values of each leaf are, in one step from its place instead of four from the tree's root: of a
/// fine grid hardly anything is in the caches where it is sampled here and there. 32 to 64 bytes for each
/// leaf. Read-only, so threads may share it.
class LeafTable {
    using Coord = openvdb::Coord;
    using Leaf = openvdb::FloatTree::LeafNodeType;

public:
    /// No leaves.
    LeafTable() = default;
    /// The tree must outlive it, and must not change.
    explicit LeafTable(const openvdb::FloatTree& tree);

    /// The values of the leaf at `leaf`, which counts in leaves; null if there is none, or if it is farther
    /// than eight million nodes from the origin: those the tree alone knows.
    const float* values_of(const Coord& leaf) const {
        if (slots_.empty() || !is_packable(leaf)) return nullptr;
        const std::uint64_t key = packed(leaf);
        for (std::size_t at = first_slot(leaf);; at = (at + 1) & mask_) {
            const std::uint64_t there = slots_[at].key.load(std::memory_order_relaxed);
            if (there == key) return slots_[at].values;
            if (there == kNone) return nullptr;
        }
    }

private:
    struct Slot {
        std::atomic<std::uint64_t> key = kNone;
        const float* values = nullptr;
    };
    static constexpr std::uint64_t kNone = ~std::uint64_t{0};

    static constexpr int kBits = 21;  // of a coordinate
    static bool is_packable(const Coord& leaf) {
        constexpr int kHalf = 1 << (kBits - 1);
        const auto fits = [&](int axis) { return leaf[axis] >= -kHalf && leaf[axis] < kHalf; };
        return fits(0) && fits(1) && fits(2);
    }
    static std::uint64_t packed(const Coord& leaf) {
        constexpr std::uint64_t kMask = (std::uint64_t{1} << kBits) - 1;
        const auto bits = [&](int axis) { return static_cast<std::uint64_t>(leaf[axis]) & kMask; };
        return bits(0) << 2 * kBits | bits(1) << kBits | bits(2);
    }
    /// Neighbours are next to each other: eight of them in two lines of a cache.
    std::size_t first_slot(const Coord& leaf) const {
        const std::uint64_t block = packed(leaf >> 1) * 0x9e3779b97f4a7c15u;
        const int within = (leaf.x() & 1) << 2 | (leaf.y() & 1) << 1 | (leaf.z() & 1);
        return (static_cast<std::size_t>(block >> 32) << 3 | static_cast<std::size_t>(within)) & mask_;
    }

    std::vector<Slot> slots_;  // a power of two, at most half of them taken
    std::size_t mask_ = 0;
};

}  // namespace isotrack
