// The layout is that of readTopology and readBuffers in openvdb/tree/{RootNode,InternalNode,LeafNode}.h and
// of readCompressedValues in openvdb/io/Compression.h, version 10.0.1.
#include "io/vdb_tree_check.h"

#include <openvdb/io/Compression.h>

#include <array>
#include <bitset>
#include <cstring>
#include <stdexcept>
#include <vector>

namespace isotrack {
namespace {

constexpr std::size_t kLeafValues = 512;

class TreeWalk {
public:
    TreeWalk(std::string_view bytes, const VdbValueLayout& layout) : bytes_(bytes), layout_(layout) {}

    VdbTreeExtent extent() {
        read_root();
        VdbTreeExtent result;
        result.leaves.reserve(active_.size());
        for (const std::size_t active : active_) {
            result.leaves.push_back(at_);
            take(kLeafValues / 8);
            skip_values(kLeafValues, active);
        }
        result.end = at_;
        return result;
    }

private:
    std::string_view take(std::uint64_t count) {
        if (count > bytes_.size() - at_) throw std::runtime_error("its voxels end too early");
        const std::string_view taken = bytes_.substr(at_, static_cast<std::size_t>(count));
        at_ += static_cast<std::size_t>(count);
        return taken;
    }

    template <typename T>
    static T number(std::string_view bytes, std::size_t offset = 0) {
        T value;
        std::memcpy(&value, bytes.data() + offset, sizeof(T));
        return value;
    }

    template <typename T>
    T take_number() {
        return number<T>(take(sizeof(T)));
    }

    /// Of a whole number of words.
    static std::size_t count_on(std::string_view mask) {
        std::size_t count = 0;
        for (std::size_t at = 0; at < mask.size(); at += sizeof(std::uint64_t))
            count += std::bitset<64>(number<std::uint64_t>(mask, at)).count();
        return count;
    }

    void read_root() {
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

    void read_internal(int log2_dim) {
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
    void skip_values(std::size_t count, std::size_t active) {
        using namespace openvdb::io;
        const auto kind = take_number<std::int8_t>();
        if (kind == NO_MASK_AND_ONE_INACTIVE_VAL || kind == MASK_AND_ONE_INACTIVE_VAL)
            take(layout_.value_bytes);
        if (kind == MASK_AND_TWO_INACTIVE_VALS) take(2 * layout_.value_bytes);
        if (kind == MASK_AND_NO_INACTIVE_VALS || kind == MASK_AND_ONE_INACTIVE_VAL ||
            kind == MASK_AND_TWO_INACTIVE_VALS)
            take(count / 8);
        const bool active_only =
            (layout_.compression & COMPRESS_ACTIVE_MASK) != 0 && kind != NO_MASK_AND_ALL_VALS;
        skip_block(active_only ? active : count);
    }

    void skip_block(std::size_t count) {
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
        const std::string_view block = take(static_cast<std::uint64_t>(stated));
        if ((layout_.compression & COMPRESS_BLOSC) == 0) return;
        // Blosc's header: four bytes of version and flags; then, 32 bits each, lengths unpacked, of a part,
        // and packed.
        if (block.size() < 16 || number<std::uint32_t>(block, 4) != expected ||
            number<std::uint32_t>(block, 12) > block.size())
            throw std::runtime_error("a block of its voxels has a wrong header");
    }

    std::string_view bytes_;
    std::size_t at_ = 0;
    VdbValueLayout layout_;
    std::vector<std::size_t> active_;  ///< Active voxels of each leaf, in the order of their buffers.
};

}  // namespace

VdbTreeExtent check_vdb_tree(std::string_view bytes, const VdbValueLayout& layout) {
    return TreeWalk(bytes, layout).extent();
}

}  // namespace isotrack
