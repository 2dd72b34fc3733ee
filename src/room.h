// How arrays with an entry per particle or per cell grow.
#pragma once

#include <cstddef>
#include <vector>

namespace isotrack {

/// Room for one more entry; when there is none, for a sixteenth of what is there: a DT gains few particles at
/// a time, for which twice the memory would be too much.
template <typename T>
void ensure_room(std::vector<T>& values) {
    constexpr std::size_t kSlack = 16;
    if (values.size() == values.capacity()) values.reserve(values.size() + values.size() / kSlack + kSlack);
}

}  // namespace isotrack
