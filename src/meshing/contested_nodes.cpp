#include "meshing/contested_nodes.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <tuple>

namespace isotrack {
namespace {

/// The lines run a hair beside the nodes, so that they miss the vertices and edges of meshes that are aligned
/// with the lattice.
constexpr double kBeside[2] = {1.3e-7, 2.9e-7};

/// Where a lattice line in the third direction meets the mesh.
struct Hit {
    int x, y, component;
    double z;
};

/// An edge seen along the lines.
class Edge {
public:
    Edge(const Vec3& p, const Vec3& q) {
        const bool swap = std::tie(p.x(), p.y(), p.z()) > std::tie(q.x(), q.y(), q.z());
        const Vec3 &a = swap ? q : p, &b = swap ? p : q;
        x_ = a.x();
        y_ = a.y();
        dx_ = b.x() - x_;
        dy_ = b.y() - y_;
        sign_ = swap ? -1.0 : 1.0;
    }
    /// Twice the signed area of p, q and (x, y); of a shared edge both triangles get the same bits but for
    /// the sign.
    double area2(double x, double y) const { return sign_ * (dx_ * (y - y_) - dy_ * (x - x_)); }

private:
    double x_, y_, dx_, dy_, sign_;
};

std::vector<Hit> hits_of(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                         const std::vector<int>& component) {
    constexpr std::size_t kBlock = 512;
    std::vector<std::vector<Hit>> blocks((triangles.size() + kBlock - 1) / kBlock);
    const auto add_hits = [&](std::size_t t, std::vector<Hit>& hits) {
        const Vec3 &a = points[triangles[t][0]], &b = points[triangles[t][1]], &c = points[triangles[t][2]];
        const Vec3 low = a.cwiseMin(b).cwiseMin(c), high = a.cwiseMax(b).cwiseMax(c);
        const Edge bc(b, c), ca(c, a), ab(a, b);
        for (int x = static_cast<int>(std::ceil(low.x() - kBeside[0])); x + kBeside[0] <= high.x(); ++x)
            for (int y = static_cast<int>(std::ceil(low.y() - kBeside[1])); y + kBeside[1] <= high.y(); ++y) {
                const double px = x + kBeside[0], py = y + kBeside[1];
                const double wa = bc.area2(px, py), wb = ca.area2(px, py), wc = ab.area2(px, py);
                if (!((wa > 0.0 && wb > 0.0 && wc > 0.0) || (wa < 0.0 && wb < 0.0 && wc < 0.0))) continue;
                hits.push_back({x, y, component[t], (wa * a.z() + wb * b.z() + wc * c.z()) / (wa + wb + wc)});
            }
    };
    tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t block) {
        const std::size_t end = std::min(triangles.size(), (block + 1) * kBlock);
        for (std::size_t t = block * kBlock; t < end; ++t) add_hits(t, blocks[block]);
    });
    std::vector<Hit> hits;
    for (auto& block : blocks) {
        hits.insert(hits.end(), block.begin(), block.end());
        std::vector<Hit>().swap(block);
    }
    return hits;
}

/// Flags the components with a node between two hits of their own on one line; `end` is behind its last hit.
void flag_holders(const Hit* begin, const Hit* end, std::vector<char>& paired,
                  std::vector<std::atomic<char>>& holds_node) {
    paired.assign(static_cast<std::size_t>(end - begin), 0);
    for (const Hit* a = begin; a != end; ++a) {
        if (paired[a - begin]) continue;
        const Hit* b = std::find_if(
            a + 1, end, [&](const Hit& h) { return h.component == a->component && !paired[&h - begin]; });
        if (b == end) continue;  // an odd hit: the line grazes an edge
        paired[b - begin] = 1;
        if (std::floor(b->z) >= a->z) holds_node[a->component].store(1, std::memory_order_relaxed);
    }
}

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

Layer merge(const LatticeLayers<Hit>::Range& hits, const std::vector<std::atomic<char>>& holds_node,
            const LatticeSides::Uprights::Range& uprights) {
    Layer layer;
    auto [h, last_hit] = hits;
    auto [u, last_upright] = uprights;
    const auto skip = [&, end = last_hit](const Hit* hit) {
        while (hit != end && !holds_node[hit->component].load(std::memory_order_relaxed)) ++hit;
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
    const LatticeLayers<Hit> hits(hits_of(points, triangles, component));
    const LatticeSides::Uprights& uprights = sides.uprights();
    if (hits.empty() && uprights.empty()) return {{}, std::vector<char>(components, 0)};
    const int low_x = hits.empty()       ? uprights.low_x()
                      : uprights.empty() ? hits.low_x()
                                         : std::min(hits.low_x(), uprights.low_x());
    const int end_x =
        std::max(hits.empty() ? low_x : hits.end_x(), uprights.empty() ? low_x : uprights.end_x());

    std::vector<std::atomic<char>> holds_node(components);  // flagged by several threads
    tbb::parallel_for(low_x, end_x, [&](int x) {
        std::vector<char> paired;
        auto [line, end] = hits.layer(x);
        while (line != end) {
            const Hit* next = std::find_if(line, end, [&](const Hit& h) { return h.y != line->y; });
            flag_holders(line, next, paired, holds_node);
            line = next;
        }
    });
    std::vector<Layer> layers(static_cast<std::size_t>(end_x - low_x));
    tbb::parallel_for(low_x, end_x, [&](int x) {
        layers[x - low_x] = merge(hits.layer(x), holds_node, uprights.layer(x));
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

    Contested result;
    for (const auto& nodes : contested) result.nodes.insert(result.nodes.end(), nodes.begin(), nodes.end());
    result.holds_node.assign(holds_node.begin(), holds_node.end());
    return result;
}

}  // namespace isotrack
