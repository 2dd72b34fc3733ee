#include "tracking/kept_flips.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>

namespace isotrack {
namespace {

/// `of_vertex`: what stands for each vertex.
Triangle renamed(const Triangle& t, const std::vector<int>& of_vertex) {
    return {of_vertex[t[0]], of_vertex[t[1]], of_vertex[t[2]]};
}

}  // namespace

KeptFlips::KeptFlips(const std::vector<std::array<int, 2>>& flips, const std::vector<Triangle>& before,
                     const CarvedSurface& carved) {
    std::vector<int> next(before.size());  // in a cycle through the triangles of a group
    std::iota(next.begin(), next.end(), 0);
    const auto are_together = [&](int t, int u) {
        for (int w = next[t]; w != t; w = next[w])
            if (w == u) return true;
        return false;
    };
    for (const auto& [t, u] : flips)
        if (!are_together(t, u)) std::swap(next[t], next[u]);  // joins the two cycles
    int group = 0;
    for (const auto& flip : flips) {
        if (next[flip[0]] < 0) continue;  // with an earlier flip
        for (int t = flip[0]; next[t] >= 0;) {
            flipped_.push_back({group, t, renamed(before[t], carved.particle),
                                renamed(carved.triangles[t], carved.particle)});
            t = std::exchange(next[t], -1);
        }
        ++group;
    }
}

template <typename Keep>
void KeptFlips::filter_groups(const Keep& keep) {
    auto kept = flipped_.begin();
    for (auto from = flipped_.begin(); from != flipped_.end();) {
        const auto to = std::find_if(from, flipped_.end(),
                                     [&](const Flipped& other) { return other.group != from->group; });
        if (keep(from, to)) kept = std::move(from, to, kept);
        from = to;
    }
    flipped_.erase(kept, flipped_.end());
}

void KeptFlips::put_into(CarvedSurface& carved, const std::vector<int>& now, const std::vector<int>& vertex,
                         std::vector<char>& around) {
    filter_groups([&](auto from, auto to) {
        const bool stays = std::all_of(from, to, [&](const Flipped& f) {
            return now[f.triangle] >= 0 &&
                   std::all_of(f.after.begin(), f.after.end(), [&](int p) { return vertex[p] >= 0; });
        });
        for (; from != to; ++from) {
            from->triangle = now[from->triangle];
            if (stays)
                carved.triangles[from->triangle] = renamed(from->after, vertex);
            else if (from->triangle >= 0)
                for (const int v : carved.triangles[from->triangle]) around[v] = 1;
        }
        return stays;
    });
}

bool KeptFlips::undo_at(const std::vector<char>& flagged, const std::vector<int>& vertex,
                        CarvedSurface& carved) {
    const std::size_t count = flipped_.size();
    filter_groups([&](auto from, auto to) {
        const bool stays = std::none_of(from, to, [&](const Flipped& f) {
            return std::any_of(f.after.begin(), f.after.end(), [&](int p) { return flagged[vertex[p]]; });
        });
        for (; !stays && from != to; ++from) carved.triangles[from->triangle] = renamed(from->before, vertex);
        return stays;
    });
    return flipped_.size() < count;
}

}  // namespace isotrack
