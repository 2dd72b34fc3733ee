#include "meshing/contested_nodes.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>
#include <vector>

#include "meshing/mesh_lines.h"
#include "meshing/torn_components.h"

namespace isotrack {
namespace {

using Hit = MeshLines::Hit;

/// A layer of lines and what crosses them, mesh and surface in turn by z.
struct Layer {
    struct Crossing {
        double z;
        bool of_mesh;
    };
    struct Line {
        int y;
        std::size_t begin, end;
        bool in_step;  // the crossings come in pairs, one of the mesh, one of the surface
    };
    std::vector<Crossing> crossings;
    std::vector<Line> lines;
};

Layer merge(const MeshLines::Range& hits, const std::vector<char>& is_part, const Uprights::Range& uprights) {
    Layer layer;
    auto [h, last_hit] = hits;
    auto [u, last_upright] = uprights;
    const auto skip = [&, last_hit = last_hit](const Hit* hit) {
        while (hit != last_hit && !is_part[hit->component]) ++hit;
        return hit;
    };
    for (h = skip(h); h != last_hit || u != last_upright;) {
        const bool of_mesh = u == last_upright || (h != last_hit && std::make_tuple(h->y, h->z) <
                                                                        std::make_tuple(u->y, u->z + 0.5));
        const int y = of_mesh ? h->y : u->y;
        if (layer.lines.empty() || layer.lines.back().y != y)
            layer.lines.push_back({y, layer.crossings.size(), 0, false});
        layer.crossings.push_back({of_mesh ? h->z : u->z + 0.5, of_mesh});
        layer.lines.back().end = layer.crossings.size();
        if (of_mesh)
            h = skip(h + 1);
        else
            ++u;
    }
    for (Layer::Line& line : layer.lines) {
        line.in_step = (line.end - line.begin) % 2 == 0;
        for (std::size_t c = line.begin; c + 1 < line.end; c += 2)
            line.in_step = line.in_step && layer.crossings[c].of_mesh != layer.crossings[c + 1].of_mesh;
    }
    return layer;
}

/// Whether nodes between the crossings number `pair` of a line, from `low` to `high`, matter on account of
/// this line or one beside it.
bool is_contested(const Layer& layer, const Layer::Line& line, std::size_t pair, int low, int high) {
    if (!line.in_step) return true;
    for (std::size_t c = line.begin + 2 * (1 - pair % 2); c < line.end;
         c += 4)  // those that face the other way
        if (layer.crossings[c].z < high + 1 && layer.crossings[c + 1].z > low - 1) return true;
    return false;
}

}  // namespace

Contested contested_nodes(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                          const std::vector<int>& component, int components, const LatticeSides& sides) {
    MeshLines lines(points, triangles, component, components);
    const Uprights& uprights = sides.uprights();
    Contested result;
    result.is_part = lines.holds_node();
    for (const int c : torn_components(lines, points, triangles, component, result.is_part, sides))
        result.is_part[c] = 0;
    if (lines.empty() && uprights.empty()) return result;
    const int low_x = lines.empty()      ? uprights.low_x()
                      : uprights.empty() ? lines.low_x()
                                         : std::min(lines.low_x(), uprights.low_x());
    const int end_x =
        std::max(lines.empty() ? low_x : lines.end_x(), uprights.empty() ? low_x : uprights.end_x());

    std::vector<Layer> layers(static_cast<std::size_t>(end_x - low_x));
    tbb::parallel_for(low_x, end_x, [&](int x) {
        layers[x - low_x] = merge(lines.layer(x), result.is_part, uprights.layer(x));
        lines.forget_layer(x);
    });

    std::vector<std::vector<Node>> contested(layers.size());
    tbb::parallel_for(std::size_t{0}, layers.size(), [&](std::size_t l) {
        const Layer& own = layers[l];
        std::vector<Node>& nodes = contested[l];
        // The layers around, and the first line in each that is not before the last one of the line looked
        // at.
        std::vector<std::pair<const Layer*, std::size_t>> beside;
        for (std::size_t other = l == 0 ? 0 : l - 1; other < std::min(l + 2, layers.size()); ++other)
            beside.emplace_back(&layers[other], 0);
        for (const Layer::Line& line : own.lines) {
            for (auto& [layer, at] : beside)
                while (at < layer->lines.size() && layer->lines[at].y < line.y - 1) ++at;
            for (std::size_t c = line.begin; c + 1 < line.end; c += 2) {
                const int low = static_cast<int>(std::ceil(own.crossings[c].z)),
                          high = static_cast<int>(std::floor(own.crossings[c + 1].z));
                if (low > high) continue;
                bool matters = false;
                for (const auto& [layer, at] : beside)
                    for (std::size_t i = at; i < layer->lines.size() && layer->lines[i].y <= line.y + 1; ++i)
                        matters =
                            matters || is_contested(*layer, layer->lines[i], (c - line.begin) / 2, low, high);
                for (int z = low; matters && z <= high; ++z) {
                    const Node node = {static_cast<int>(l) + low_x, line.y, z};
                    if (nodes.empty() || nodes.back() < node) nodes.push_back(node);
                }
            }
        }
    });

    for (const auto& nodes : contested) result.nodes.insert(result.nodes.end(), nodes.begin(), nodes.end());
    return result;
}

}  // namespace isotrack
