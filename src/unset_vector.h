// Arrays that are filled by several threads.
#pragma once

#include <memory>
#include <new>
#include <type_traits>
#include <utility>
#include <vector>

namespace isotrack {

/// Leaves new elements unset, to be written before they are read: no thread goes over all of them, and touches
/// their memory, before those that fill them do.
template <typename T>
struct LeaveUnset : std::allocator<T> {
    static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);
    LeaveUnset() = default;
    template <typename U>
    LeaveUnset(const LeaveUnset<U>&) {}
    template <typename U>
    struct rebind {
        using other = LeaveUnset<U>;
    };
    template <typename U, typename... Arguments>
    void construct(U* place, Arguments&&... arguments) {
        if constexpr (sizeof...(Arguments) > 0) ::new (place) U(std::forward<Arguments>(arguments)...);
    }
};

template <typename T>
using UnsetVector = std::vector<T, LeaveUnset<T>>;

}  // namespace isotrack
