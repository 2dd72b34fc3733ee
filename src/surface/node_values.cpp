#include "surface/node_values.h"

#include <algorithm>

namespace isotrack {

// Out of line, so that the compiler inlines `at` and `block`.

void NodeValues::fetch(const Coord& node, const Coord& at, Place& place) {
    place.leaf = at;
    if (const float* known = table_ ? table_->values_of(at) : nullptr) {
        place.values = known;
    } else if (const Leaf* found = leaves_.probeConstLeaf(node)) {
        place.values = found->buffer().data();
    } else if (const float value = leaves_.getValue(node); value == far_[value < 0.0f][0]) {
        place.values = far_[value < 0.0f];
    } else {
        if (!place.tile) place.tile = std::make_unique<float[]>(Leaf::SIZE);
        std::fill_n(place.tile.get(), Leaf::SIZE, value);
        place.values = place.tile.get();
    }
    std::fill_n(&place.beyond[0][0][0], 8, nullptr);
    place.beyond[0][0][0] = place.values;
}

const float* NodeValues::meet(const float*& known, const Coord& node) {
    const Place& place = place_of(node);
    if (place.values != place.tile.get()) known = place.values;  // its own tile is written over
    return place.values;
}

}  // namespace isotrack
