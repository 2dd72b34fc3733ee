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

using Edges = std::vector<std::pair<int, int>>;  // each from the lower end, ascending

void add_edges(const Triangle& t, Edges& edges) {
    for (int k = 0; k < 3; ++k) edges.push_back(std::minmax(t[k], t[(k + 1) % 3]));
}
bool has(const Edges& edges, const std::pair<int, int>& edge) {
    return std::binary_search(edges.begin(), edges.end(), edge);
}

/// Of the triangles that stand for none of the last mesh.
Edges edges_of_new(const std::vector<Triangle>& triangles, const std::vector<int>& now) {
    std::vector<char> is_new(triangles.size(), 1);
    for (const int t : now)
        if (t >= 0) is_new[t] = 0;
    Edges result;
    for (std::size_t t = 0; t < triangles.size(); ++t)
        if (is_new[t]) add_edges(triangles[t], result);
    std::sort(result.begin(), result.end());
    return result;
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
        if (keep(from, to)) kept = kept == from ? to : std::move(from, to, kept);
        from = to;
    }
    flipped_.erase(kept, flipped_.end());
}

void KeptFlips::put_into(CarvedSurface& carved, const std::vector<int>& now, const std::vector<int>& vertex,
                         std::vector<char>& around) {
    if (flipped_.empty()) return;
    const Edges of_new = edges_of_new(carved.triangles, now);
    filter_groups([&](auto from, auto to) {
        bool stays = std::all_of(from, to, [&](const Flipped& f) {
            return now[f.triangle] >= 0 &&
                   std::all_of(f.after.begin(), f.after.end(), [&](int p) { return vertex[p] >= 0; });
        });
        if (stays) {
            Edges before, after;
            std::for_each(from, to, [&](const Flipped& f) {
                add_edges(renamed(f.before, vertex), before);
                add_edges(renamed(f.after, vertex), after);
            });
            std::sort(before.begin(), before.end());
            stays = std::none_of(after.begin(), after.end(),
                                 [&](const auto& edge) { return !has(before, edge) && has(of_new, edge); });
        }
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

bool KeptFlips::undo_at(std::vector<char>& flagged, const std::vector<int>& vertex, CarvedSurface& carved) {
    const std::size_t count = flipped_.size();
    for (std::size_t before = 0; before != flipped_.size();) {  // until no flag hits another group
        before = flipped_.size();
        filter_groups([&](auto from, auto to) {
            const bool stays = std::none_of(from, to, [&](const Flipped& f) {
                return std::any_of(f.after.begin(), f.after.end(), [&](int p) { return flagged[vertex[p]]; });
            });
            for (; !stays && from != to; ++from) {
                carved.triangles[from->triangle] = renamed(from->before, vertex);
                for (const int p : from->before) flagged[vertex[p]] = 1;
            }
            return stays;
        });
    }
    return flipped_.size() < count;
}

}  // namespace isotrack
