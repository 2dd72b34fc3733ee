// A probe for every thread that asks.
#pragma once

#include <tbb/enumerable_thread_specific.h>

#include <memory>

#include "isotrack/surface/surface.h"

namespace isotrack {

class ThreadProbes {
public:
    /// `surface` must outlive it.
    explicit ThreadProbes(const Surface& surface) : probes_([&surface] { return surface.probe(); }) {}
    Surface::Probe& local() { return *probes_.local(); }

private:
    tbb::enumerable_thread_specific<std::unique_ptr<Surface::Probe>> probes_;
};

}  // namespace isotrack
