// How arrays with an entry per particle or per cell grow.
#pragma once

#include <cstddef>
#include <vector>

namespace isotrack {

/// Room for a sixteenth more than `size`: a DT gains few particles at a time, for which twice the memory would
/// be too much.
template <typename T>
void reserve_with_slack(std::vector<T>& values, std::size_t size) {
    constexpr std::size_t kSlack = 16;
    values.reserve(size + size / kSlack + kSlack);
}

/// Room for one more entry, and with slack where there is none.
template <typename T>
void ensure_room(std::vector<T>& values) {
    if (values.size() == values.capacity()) reserve_with_slack(values, values.size());
}

}  // namespace isotrack
