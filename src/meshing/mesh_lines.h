// Where the lattice lines in the third direction meet a mesh.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "isotrack/types.h"

namespace isotrack {

/// In layers of one x, ascending there by line and along it.
class MeshLines {
public:
    struct Hit {
        int y, component;
        double z;
    };
    using Range = std::pair<const Hit*, const Hit*>;

    /// `points` in lattice units; `component` per triangle, below `components`. Uses TBB inside.
    MeshLines(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
              const std::vector<int>& component, int components);

    /// The layers from `low_x()` up to, but not including, `end_x()` may hold some.
    int low_x() const { return low_x_; }
    int end_x() const { return low_x_ + static_cast<int>(layers_.size()); }
    bool empty() const { return layers_.empty(); }
    Range layer(int x) const;
    Range line(int x, int y) const;
    /// Per component: there is a node between two hits of it on one line.
    const std::vector<char>& holds_node() const { return holds_node_; }
    /// They are of no more use.
    void forget_layer(int x) {
        if (x >= low_x() && x < end_x()) std::vector<Hit>().swap(layers_[x - low_x_]);
    }

    /// Calls `visit(first, last)` with pairs of hits of one component on a line, of each the first with the
    /// second and so on: it is between them. The last of an odd number is left out: the line grazes an edge.
    template <typename Visit>
    static void for_each_pair(const Range& line, const Visit& visit);

private:
    int low_x_ = 0;
    std::vector<std::vector<Hit>> layers_;
    std::vector<char> holds_node_;
};

template <typename Visit>
void MeshLines::for_each_pair(const Range& line, const Visit& visit) {
    const auto [begin, end] = line;
    thread_local std::vector<char> paired;  // there are many lines
    paired.assign(static_cast<std::size_t>(end - begin), 0);
    for (const Hit* a = begin; a != end; ++a) {
        if (paired[a - begin]) continue;
        const Hit* b = std::find_if(a + 1, end, [&, begin = begin](const Hit& h) {
            return h.component == a->component && !paired[&h - begin];
        });
        if (b == end) continue;
        paired[b - begin] = 1;
        visit(*a, *b);
    }
}

}  // namespace isotrack
