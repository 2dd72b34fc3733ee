#include "tracking/kept_flips.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "sampling/compact.h"

namespace isotrack {
namespace {

/// `of_vertex`: what stands for each vertex.
Triangle renamed(const Triangle& t, const std::vector<int>& of_vertex) {
    return {of_vertex[t[0]], of_vertex[t[1]], of_vertex[t[2]]};
}

using Edge = std::pair<int, int>;  // from the lower end

std::array<Edge, 3> edges_of(const Triangle& t) {
    return {std::minmax(t[0], t[1]), std::minmax(t[1], t[2]), std::minmax(t[2], t[0])};
}
bool has_edge(const Triangle& t, const Edge& edge) {
    const auto edges = edges_of(t);
    return std::find(edges.begin(), edges.end(), edge) != edges.end();
}

/// Of the triangles that stand for none of the last mesh, ascending.
std::vector<Edge> edges_of_new(const std::vector<Triangle>& triangles, const std::vector<int>& now) {
    std::vector<char> is_new(triangles.size(), 1);
    for (const int t : now)
        if (t >= 0) is_new[t] = 0;
    std::vector<Edge> result;
    for (std::size_t t = 0; t < triangles.size(); ++t)
        if (is_new[t])
            for (const Edge& edge : edges_of(triangles[t])) result.push_back(edge);
    std::sort(result.begin(), result.end());
    return result;
}

}  // namespace

KeptFlips::KeptFlips(const std::vector<std::array<int, 2>>& flips, const std::vector<Triangle>& before,
                     const CarvedSurface& carved) {
    flips_.reserve(flips.size());
    for (const auto& flip : flips) {
        Kept kept{flip, {}, {}};
        for (int i = 0; i < 2; ++i) {
            kept.before[i] = renamed(before[flip[i]], carved.particle);
            kept.after[i] = renamed(carved.triangles[flip[i]], carved.particle);
        }
        flips_.push_back(kept);
    }
}

void KeptFlips::put_into(CarvedSurface& carved, const std::vector<int>& now, const std::vector<int>& vertex,
                         std::vector<char>& around) {
    if (flips_.empty()) return;
    const std::vector<Edge> of_new = edges_of_new(carved.triangles, now);
    const auto is_there = [&](const Kept& flip) {
        for (int i = 0; i < 2; ++i)
            if (now[flip.triangle[i]] < 0 ||
                std::any_of(flip.after[i].begin(), flip.after[i].end(), [&](int p) { return vertex[p] < 0; }))
                return false;
        const Triangle before[2] = {renamed(flip.before[0], vertex), renamed(flip.before[1], vertex)};
        for (const Triangle& after : flip.after)
            for (const Edge& edge : edges_of(renamed(after, vertex)))
                if (!has_edge(before[0], edge) && !has_edge(before[1], edge) &&
                    std::binary_search(of_new.begin(), of_new.end(), edge))
                    return false;
        return true;
    };
    std::vector<char> keep;
    keep.reserve(flips_.size());
    for (Kept& flip : flips_) {
        keep.push_back(is_there(flip));
        for (int i = 0; i < 2; ++i) {
            int& triangle = flip.triangle[i];
            triangle = now[triangle];
            if (keep.back())
                carved.triangles[triangle] = renamed(flip.after[i], vertex);
            else if (triangle >= 0)
                for (const int v : carved.triangles[triangle]) around[v] = 1;
        }
    }
    compact(flips_, keep);
}

bool KeptFlips::undo_at(std::vector<char>& flagged, const std::vector<int>& vertex, CarvedSurface& carved) {
    const auto is_flagged = [&](const Triangle& t) {
        return std::any_of(t.begin(), t.end(), [&](int p) { return flagged[vertex[p]]; });
    };
    std::vector<char> keep(flips_.size(), 1);
    bool any = false;
    for (bool changed = true; changed;) {  // until no flag hits another
        changed = false;
        for (std::size_t f = 0; f < flips_.size(); ++f) {
            const Kept& flip = flips_[f];
            if (!keep[f] || (!is_flagged(flip.after[0]) && !is_flagged(flip.after[1]))) continue;
            for (int i = 0; i < 2; ++i) {
                carved.triangles[flip.triangle[i]] = renamed(flip.before[i], vertex);
                for (const int p : flip.before[i]) flagged[vertex[p]] = 1;
            }
            keep[f] = 0;
            any = changed = true;
        }
    }
    compact(flips_, keep);
    return any;
}

}  // namespace isotrack
