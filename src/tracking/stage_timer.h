// The seconds of a frame's stages.
#pragma once

#include <chrono>
#include <map>
#include <string>

namespace isotrack {

/// Adds the time from its construction to its destruction to a stage.
class StageTimer {
public:
    StageTimer(std::map<std::string, double>& seconds, const char* stage)
        : total_(seconds[stage]), start_(std::chrono::steady_clock::now()) {}
    ~StageTimer() {
        total_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
    }

private:
    double& total_;
    std::chrono::steady_clock::time_point start_;
};

}  // namespace isotrack
