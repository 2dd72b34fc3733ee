// Memory that comes from the system and goes back to it.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <memory>
#include <new>
#include <string_view>

namespace isotrack {

/// Bytes for a moment, beside the heap: the hole that a large block leaves there is broken up by what is
/// allocated next, and the heap grows by another such block for the next file.
class SystemMemory {
public:
    /// \throws std::bad_alloc
    explicit SystemMemory(std::size_t size) : bytes_(nullptr, Unmap{size}) {
        if (size == 0) return;
        void* bytes = ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        if (bytes == MAP_FAILED) throw std::bad_alloc();
        bytes_.reset(static_cast<char*>(bytes));
    }
    char* data() const {
        return bytes_.get();
    }
    std::size_t size() const {
        return bytes_.get_deleter().size;
    }
    std::string_view view() const {
        return {data(), size()};
    }

private:
    struct Unmap {
        std::size_t size;
        void operator()(char* bytes) const { ::munmap(bytes, size); }
    };
    std::unique_ptr<char, Unmap> bytes_;
};

}  // namespace isotrack
