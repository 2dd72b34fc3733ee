// Which triangles' boxes meet.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "isotrack/types.h"

namespace isotrack {

/// The bounding boxes of some triangles, in a balanced binary tree over leaves of those that follow each
/// other. Boxes are in floats from the least corner of all points on, rounded outwards: those less than 2e-7
/// of the extent of all points apart may be said to meet. Some 32 bytes a box, 36 while it is made. Points
/// must be finite. Making it uses TBB inside; it is read-only, so threads may share it.
class BoxTree {
public:
    /// Of those with a flag in `some`, along Hilbert's curve.
    BoxTree(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
            const std::vector<char>& some);
    /// In this order, one box for each run of `run_length` triangles that follow each other. Run n begins
    /// with triangle n times `run_length`; it is visited as triangle n is where each has a box of its own.
    BoxTree(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
            const std::vector<int>& order, int run_length);

    std::size_t leaf_count() const { return leaves_.size(); }
    std::vector<int> order() const;  ///< Of all triangles or runs, leaf by leaf.

    /// Calls `visit(t, u)` with the pairs of triangles whose boxes meet, once with each: t is in this leaf, u
    /// in it or in one behind it.
    template <typename Visit>
    void for_each_pair_of(std::size_t leaf, const Visit& visit) const {
        const Leaf& own = leaves_[leaf];
        for_each_leaf(bounds_[first_ + leaf], leaf, [&](std::size_t other) {
            for (int m = 0; m < own.count; ++m) {
                const Bounds box = own.box(m);
                if (box.meets(bounds_[first_ + other]))
                    leaves_[other].for_each_meeting(box, other == leaf ? m + 1 : 0,
                                                    [&](int t) { visit(own.triangle[m], t); });
            }
        });
    }
    /// Calls `visit(t)` with those whose boxes meet this one.
    template <typename Visit>
    void for_each_meeting(const Box& box, const Visit& visit) const {
        const Bounds there = rounded(box);
        for_each_leaf(there, 0, [&](std::size_t leaf) { leaves_[leaf].for_each_meeting(there, 0, visit); });
    }

private:
    static constexpr int kPerLeaf = 16;

    struct Bounds {
        std::array<float, 3> low, high;

        bool meets(const Bounds& b) const {  // without a branch, which would be mispredicted
            return ((low[0] <= b.high[0]) & (high[0] >= b.low[0]) & (low[1] <= b.high[1]) &
                    (high[1] >= b.low[1]) & (low[2] <= b.high[2]) & (high[2] >= b.low[2])) != 0;
        }
    };
    /// Values next to each other are compared by one instruction. Behind the last triangle is what meets
    /// nothing.
    struct Leaf {
        float low[3][kPerLeaf], high[3][kPerLeaf];
        int triangle[kPerLeaf];
        int count;

        Bounds box(int m) const {
            return {{low[0][m], low[1][m], low[2][m]}, {high[0][m], high[1][m], high[2][m]}};
        }
        template <typename Visit>
        void for_each_meeting(const Bounds& box, int from, const Visit& visit) const {
            int meets[kPerLeaf];
            for (int m = 0; m < kPerLeaf; ++m)
                meets[m] = (box.low[0] <= high[0][m]) & (box.high[0] >= low[0][m]) &
                           (box.low[1] <= high[1][m]) & (box.high[1] >= low[1][m]) &
                           (box.low[2] <= high[2][m]) & (box.high[2] >= low[2][m]);
            for (int m = from; m < kPerLeaf; ++m)
                if (meets[m] != 0) visit(triangle[m]);
        }
    };

    Bounds rounded(const Box& box) const;

    /// Calls `visit(leaf)` with those from `from` on whose bounds meet a box.
    template <typename Visit>
    void for_each_leaf(const Bounds& box, std::size_t from, const Visit& visit) const {
        if (leaves_.empty()) return;
        struct Node {
            std::size_t number;
            int below;  // levels
        };
        std::array<Node, 64> stack;
        std::size_t size = 0;
        stack[size++] = {1, levels_};
        while (size > 0) {
            const auto [node, below] = stack[--size];
            // Where its last leaf is before that one, so are all.
            if (node < (first_ + from) >> below || !bounds_[node].meets(box)) continue;
            if (below == 0) {
                visit(node - first_);
                continue;
            }
            stack[size++] = {2 * node + 1, below - 1};
            stack[size++] = {2 * node, below - 1};
        }
    }

    Vec3 origin_ = Vec3::Zero();
    std::vector<Leaf> leaves_;
    int levels_ = 0;              // below the root
    std::size_t first_ = 1;       // node that is a leaf
    std::vector<Bounds> bounds_;  // of the nodes: below n are 2 n and 2 n + 1, the root is 1
};

}  // namespace isotrack
