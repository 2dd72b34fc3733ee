#include "tracking/kept_flips.h"

#include <algorithm>
#include <cstddef>
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

/// In order, and each is looked at once.
template <typename T, typename Keep>
void keep_those(std::vector<T>& values, const Keep& keep) {
    auto kept = values.begin();
    for (T& value : values)
        if (keep(value)) *kept++ = value;
    values.erase(kept, values.end());
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
    keep_those(flips_, [&](Kept& flip) {
        const bool stays = is_there(flip);
        for (int i = 0; i < 2; ++i) {
            int& triangle = flip.triangle[i];
            triangle = now[triangle];
            if (stays)
                carved.triangles[triangle] = renamed(flip.after[i], vertex);
            else if (triangle >= 0)
                for (const int v : carved.triangles[triangle]) around[v] = 1;
        }
        return stays;
    });
}

bool KeptFlips::undo_at(std::vector<char>& flagged, const std::vector<int>& vertex, CarvedSurface& carved) {
    const std::size_t count = flips_.size();
    for (std::size_t before = 0; before != flips_.size();) {  // until no flag hits another
        before = flips_.size();
        keep_those(flips_, [&](const Kept& flip) {
            const auto is_flagged = [&](const Triangle& t) {
                return std::any_of(t.begin(), t.end(), [&](int p) { return flagged[vertex[p]]; });
            };
            if (!is_flagged(flip.after[0]) && !is_flagged(flip.after[1])) return true;
            for (int i = 0; i < 2; ++i) {
                carved.triangles[flip.triangle[i]] = renamed(flip.before[i], vertex);
                for (const int p : flip.before[i]) flagged[vertex[p]] = 1;
            }
            return false;
        });
    }
    return flips_.size() < count;
}

}  // namespace isotrack
