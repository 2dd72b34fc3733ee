// Something done beside something else.
#pragma once

#include <tbb/task_group.h>

#include <exception>
#include <utility>

namespace isotrack {

/// `work()` by another thread of TBB, where one has the time, or by the one that waits. What it throws,
/// `wait` throws. An exception that comes past waits for it, too, and goes on alone.
template <typename Work>
class Beside {
public:
    explicit Beside(Work work) : work_(std::move(work)) {
        group_.run([this] {
            try {
                work_();
            } catch (...) {
                failure_ = std::current_exception();
            }
        });
    }
    Beside(const Beside&) = delete;
    ~Beside() { group_.wait(); }

    /// More than once is the same as once.
    void wait() {
        group_.wait();
        if (failure_) std::rethrow_exception(failure_);
    }

private:
    const Work work_;
    std::exception_ptr failure_;
    tbb::task_group group_;
};

}  // namespace isotrack
