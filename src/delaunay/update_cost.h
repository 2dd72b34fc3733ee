// When a DT had better be built anew.
#pragma once

#include <cstddef>

namespace isotrack {

/// Whether building the DT of `vertices` anew is predicted to be cheaper than to insert, relocate and remove
/// so many of them one by one.
inline bool building_pays(std::size_t inserted, std::size_t moved, std::size_t removed,
                          std::size_t vertices) {
    constexpr double kInsert = 2.0, kRemove = 6.0;  // in units of what building costs per vertex
    return kInsert * static_cast<double>(inserted + moved) + kRemove * static_cast<double>(moved + removed) >
           static_cast<double>(vertices);
}

}  // namespace isotrack
