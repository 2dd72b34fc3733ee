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
    const Edges of_new = edges_of_new(carved.triangles, now);
    const auto is_there = [&](const Kept& flip) {
        for (int i = 0; i < 2; ++i)
            if (now[flip.triangle[i]] < 0 ||
                std::any_of(flip.after[i].begin(), flip.after[i].end(), [&](int p) { return vertex[p] < 0; }))
                return false;
        Edges before, after;
        for (int i = 0; i < 2; ++i) {
            add_edges(renamed(flip.before[i], vertex), before);
            add_edges(renamed(flip.after[i], vertex), after);
        }
        std::sort(before.begin(), before.end());
        return std::none_of(after.begin(), after.end(),
                            [&](const auto& edge) { return !has(before, edge) && has(of_new, edge); });
    };
    std::vector<char> keep;
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
