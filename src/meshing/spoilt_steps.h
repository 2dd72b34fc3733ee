// What steps of vertices do to their triangles.
#pragma once

#include <cstddef>
#include <vector>

#include "isotrack/types.h"

namespace isotrack {

/// Steps that turn a triangle over, or give it an angle below 30 degrees that is smaller than it was. Of one
/// mesh, with memory of its own from step to step.
class SpoiltSteps {
public:
    /// Both must outlive it. `triangles` must have all around a movable vertex. `movable`: a flag per vertex,
    /// the others make no steps.
    SpoiltSteps(const std::vector<Triangle>& triangles, const std::vector<char>& movable)
        : triangles_(triangles), movable_(movable), back_(movable.size()) {}

    /// Shortens the steps from `vertices` to `to` around triangles that they spoil, and takes them back where
    /// that is not enough. A step is at most a tenth of the edges around its vertex. Uses TBB inside.
    void undo(const std::vector<Vec3>& vertices, std::vector<Vec3>& to);

private:
    /// Numbers below a limit, each once.
    class Numbers {
    public:
        explicit Numbers(std::size_t limit) : has_(limit, 0) {}
        void add(int n) {
            if (has_[n]) return;
            has_[n] = 1;
            list_.push_back(n);
        }
        bool has(int n) const { return has_[n] != 0; }
        const std::vector<int>& list() const { return list_; }
        void clear() {
            for (const int n : list_) has_[n] = 0;
            list_.clear();
        }

    private:
        std::vector<char> has_;
        std::vector<int> list_;  // in the order in which they came
    };

    const std::vector<Triangle>& triangles_;
    const std::vector<char>& movable_;
    Numbers back_;
};

}  // namespace isotrack
