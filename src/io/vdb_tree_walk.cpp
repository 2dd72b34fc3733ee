// The layout is that of readTopology and readBuffers in openvdb/tree/{RootNode,InternalNode,LeafNode}.h and
// of readCompressedValues in openvdb/io/Compression.h, version 10.0.1.
#include "io/vdb_tree_walk.h"

#include <openvdb/io/Compression.h>

#include <algorithm>
#include <array>
#include <bitset>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace isotrack {
namespace {

constexpr std::size_t kLeafValues = 512;
constexpr std::size_t kPart = 1 << 17;  // bytes, about, walked at a time
constexpr std::size_t kMostRoom = 2 * kPart;

template <typename T>
T number(std::string_view bytes, std::size_t offset = 0) {
    T value;
    std::memcpy(&value, bytes.data() + offset, sizeof(T));
    return value;
}

/// Of a whole number of words.
std::size_t count_on(std::string_view mask) {
    std::size_t count = 0;
    for (std::size_t at = 0; at < mask.size(); at += sizeof(std::uint64_t))
        count += std::bitset<64>(number<std::uint64_t>(mask, at)).count();
    return count;
}

}  // namespace

VdbTreeWalk::VdbTreeWalk(std::uint64_t size, const VdbValueLayout& layout, Read read)
    : read_(std::move(read)),
      unread_(size),
      here_(static_cast<std::size_t>(std::min<std::uint64_t>(size, kPart))),
      layout_(layout) {}

std::string_view VdbTreeWalk::topology() {
    constexpr std::size_t kLeastBuffer = kLeafValues / 8 + 1;
    read_root();
    if (active_.size() > (unread_ + (filled_ - at_)) / kLeastBuffer)
        throw std::runtime_error("its voxels end too early");
    return here_.view().substr(0, at_);
}

VdbTreeWalk::Buffers VdbTreeWalk::next_buffers() {
    give_up_walked();
    Buffers result;
    for (; next_leaf_ < active_.size() && at_ < kPart; ++next_leaf_) {
        result.begin.push_back(at_);
        take(kLeafValues / 8);
        skip_values(kLeafValues, active_[next_leaf_]);
    }
    result.bytes = here_.view().substr(0, at_);
    return result;
}

void VdbTreeWalk::give_up_walked() {
    const char* left = here_.data() + at_;
    given_up_ += at_;
    filled_ -= at_;
    at_ = 0;
    if (here_.size() > kMostRoom && filled_ <= kMostRoom) {  // after the topology, which is there at once
        SystemMemory less(kMostRoom);
        std::memcpy(less.data(), left, filled_);
        here_ = std::move(less);
    } else {
        std::memmove(here_.data(), left, filled_);
    }
}

/// The next bytes; valid until the next call.
std::string_view VdbTreeWalk::take(std::uint64_t count) {
    if (count > unread_ + (filled_ - at_)) throw std::runtime_error("its voxels end too early");
    const std::size_t end = at_ + static_cast<std::size_t>(count);
    if (end > filled_) {
        if (end > here_.size()) {
            SystemMemory more(std::max(end, 2 * here_.size()));
            std::memcpy(more.data(), here_.data(), filled_);
            here_ = std::move(more);
        }
        const auto some = static_cast<std::size_t>(
            std::min<std::uint64_t>({unread_, std::max(end - filled_, kPart), here_.size() - filled_}));
        read_(here_.data() + filled_, some);
        filled_ += some;
        unread_ -= some;
    }
    const std::string_view taken = here_.view().substr(at_, end - at_);
    at_ = end;
    return taken;
}

template <typename T>
T VdbTreeWalk::take_number() {
    return number<T>(take(sizeof(T)));
}

void VdbTreeWalk::read_root() {
    if (take_number<std::uint32_t>() != 1) throw std::runtime_error("its tree does not begin as it must");
    take(layout_.value_bytes);  // background
    const auto tiles = take_number<std::uint32_t>(), children = take_number<std::uint32_t>();
    take(std::uint64_t{tiles} * (sizeof(openvdb::Coord) + layout_.value_bytes + 1));
    // Buffers follow in the order of OpenVDB's table, which is sorted, so the children must be too.
    std::array<std::int32_t, 3> last{};
    for (std::uint32_t i = 0; i < children; ++i) {
        const auto origin = take_number<std::array<std::int32_t, 3>>();
        if (i > 0 && !(last < origin)) throw std::runtime_error("the parts of its tree are out of order");
        last = origin;
        read_internal(5);
    }
}

void VdbTreeWalk::read_internal(int log2_dim) {
    const std::size_t count = std::size_t{1} << (3 * log2_dim);
    const std::size_t children = count_on(take(count / 8));
    const std::size_t active = count_on(take(count / 8));
    skip_values(count, active);
    for (std::size_t i = 0; i < children; ++i) {
        if (log2_dim == 5)
            read_internal(4);
        else
            active_.push_back(count_on(take(kLeafValues / 8)));
    }
}

/// The values of a node with `count` of them, `active` active.
void VdbTreeWalk::skip_values(std::size_t count, std::size_t active) {
    using namespace openvdb::io;
    const auto kind = take_number<std::int8_t>();
    if (kind == NO_MASK_AND_ONE_INACTIVE_VAL || kind == MASK_AND_ONE_INACTIVE_VAL) take(layout_.value_bytes);
    if (kind == MASK_AND_TWO_INACTIVE_VALS) take(2 * layout_.value_bytes);
    if (kind == MASK_AND_NO_INACTIVE_VALS || kind == MASK_AND_ONE_INACTIVE_VAL ||
        kind == MASK_AND_TWO_INACTIVE_VALS)
        take(count / 8);
    const bool active_only =
        (layout_.compression & COMPRESS_ACTIVE_MASK) != 0 && kind != NO_MASK_AND_ALL_VALS;
    skip_block(active_only ? active : count);
}

void VdbTreeWalk::skip_block(std::size_t count) {
    constexpr std::size_t kMostHeader = 256;
    using namespace openvdb::io;
    const std::size_t expected = count * layout_.stored_bytes;
    if (layout_.half && count == 0) return;
    if ((layout_.compression & (COMPRESS_BLOSC | COMPRESS_ZIP)) == 0) {
        take(expected);
        return;
    }
    const auto stated = take_number<std::int64_t>();
    if (stated <= 0) {  // stored as it is
        if (std::uint64_t{0} - static_cast<std::uint64_t>(stated) != expected)
            throw std::runtime_error("a block of its voxels has a wrong length");
        take(expected);
        return;
    }
    // Who packs writes what does not get smaller as it is, or with a header; with ample room for others.
    if (static_cast<std::uint64_t>(stated) > 2 * expected + kMostHeader)
        throw std::runtime_error("a block of its voxels has a wrong length");
    const std::string_view block = take(static_cast<std::uint64_t>(stated));
    if ((layout_.compression & COMPRESS_BLOSC) == 0) return;
    // Blosc's header: four bytes of version and flags; then, 32 bits each, lengths unpacked, of a part,
    // and packed.
    if (block.size() < 16 || number<std::uint32_t>(block, 4) != expected ||
        number<std::uint32_t>(block, 12) > block.size())
        throw std::runtime_error("a block of its voxels has a wrong header");
}

}  // namespace isotrack
