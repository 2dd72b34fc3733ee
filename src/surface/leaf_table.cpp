#include "surface/leaf_table.h"

#include <tbb/parallel_for.h>

namespace isotrack {

LeafTable::LeafTable(const openvdb::FloatTree& tree) {
    constexpr std::size_t kFewest = 16;
    std::vector<const Leaf*> leaves;
    tree.getNodes(leaves);
    std::size_t size = kFewest;
    while (size < 2 * leaves.size()) size *= 2;
    slots_ = std::vector<Slot>(size);
    mask_ = size - 1;
    // A thread takes a slot by its key; what it writes there is read when all are done.
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, leaves.size(), 1024), [&](const auto& range) {
        for (std::size_t n = range.begin(); n < range.end(); ++n) {
            const Coord place = leaves[n]->origin() >> static_cast<int>(Leaf::LOG2DIM);
            if (!is_packable(place)) continue;
            const std::uint64_t key = packed(place);
            std::size_t at = first_slot(place);
            for (std::uint64_t none = kNone;
                 !slots_[at].key.compare_exchange_strong(none, key, std::memory_order_relaxed); none = kNone)
                at = (at + 1) & mask_;
            slots_[at].values = leaves[n]->buffer().data();
        }
    });
}

}  // namespace isotrack
