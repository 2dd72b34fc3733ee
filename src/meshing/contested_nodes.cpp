#include "meshing/contested_nodes.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>
#include <tuple>
#include <utility>
#include <vector>

#include "meshing/lattice_lines.h"

namespace isotrack {
namespace {

/// The lines run a hair beside the nodes, so that they miss the vertices and edges of meshes that are aligned
/// with the lattice.
constexpr double kBeside[2] = {1.3e-7, 2.9e-7};

/// Where a lattice line in the third direction meets the mesh.
struct Hit {
    int y, component;
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

/// The triangles over each layer of lines.
class TrianglesByLayer {
public:
    TrianglesByLayer(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles) {
        std::vector<std::pair<int, int>> layers(triangles.size());  // the first, and the one behind the last
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, triangles.size(), 1024), [&](const auto& range) {
            for (std::size_t t = range.begin(); t < range.end(); ++t) {
                const auto [low, high] = std::minmax(
                    {points[triangles[t][0]].x(), points[triangles[t][1]].x(), points[triangles[t][2]].x()});
                if (!(low <= high)) continue;
                layers[t] = {static_cast<int>(std::ceil(low - kBeside[0])),
                             static_cast<int>(std::floor(high - kBeside[0])) + 1};
            }
        });
        bool any = false;
        for (const auto& [begin, end] : layers) {
            if (begin == end) continue;
            low_x_ = any ? std::min(low_x_, begin) : begin;
            end_x_ = any ? std::max(end_x_, end) : end;
            any = true;
        }
        first_.assign(static_cast<std::size_t>(end_x_ - low_x_) + 1, 0);
        for (const auto& [begin, end] : layers)
            for (int x = begin; x < end; ++x) ++first_[x - low_x_ + 1];
        std::partial_sum(first_.begin(), first_.end(), first_.begin());
        std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
        triangles_.resize(first_.back());
        for (std::size_t t = 0; t < layers.size(); ++t)
            for (int x = layers[t].first; x < layers[t].second; ++x)
                triangles_[next[x - low_x_]++] = static_cast<int>(t);
    }
    int low_x() const { return low_x_; }
    int end_x() const { return end_x_; }
    bool empty() const { return triangles_.empty(); }
    std::pair<const int*, const int*> layer(int x) const {
        if (x < low_x_ || x >= end_x_) return {nullptr, nullptr};
        const int* all = triangles_.data();
        return {all + first_[x - low_x_], all + first_[x - low_x_ + 1]};
    }

private:
    int low_x_ = 0, end_x_ = 0;
    std::vector<std::size_t> first_;
    std::vector<int> triangles_;
};

/// Where the lines of a layer meet the mesh, ascending by line and along it.
std::vector<Hit> hits_in_layer(int x, const TrianglesByLayer& over, const std::vector<Vec3>& points,
                               const std::vector<Triangle>& triangles, const std::vector<int>& component) {
    std::vector<Hit> hits;
    const double px = x + kBeside[0];
    for (auto [t, end] = over.layer(x); t != end; ++t) {
        const Vec3 &a = points[triangles[*t][0]], &b = points[triangles[*t][1]],
                   &c = points[triangles[*t][2]];
        const Edge bc(b, c), ca(c, a), ab(a, b);
        const auto [low, high] = std::minmax({a.y(), b.y(), c.y()});
        for (int y = static_cast<int>(std::ceil(low - kBeside[1])); y + kBeside[1] <= high; ++y) {
            const double py = y + kBeside[1];
            const double wa = bc.area2(px, py), wb = ca.area2(px, py), wc = ab.area2(px, py);
            if (!((wa > 0.0 && wb > 0.0 && wc > 0.0) || (wa < 0.0 && wb < 0.0 && wc < 0.0))) continue;
            hits.push_back({y, component[*t], (wa * a.z() + wb * b.z() + wc * c.z()) / (wa + wb + wc)});
        }
    }
    sort_by_line(hits.data(), hits.data() + hits.size());
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

Layer merge(const std::vector<Hit>& hits, const std::vector<std::atomic<char>>& holds_node,
            const Uprights::Range& uprights) {
    Layer layer;
    const Hit *h = hits.data(), *last_hit = h + hits.size();
    auto [u, last_upright] = uprights;
    const auto skip = [&](const Hit* hit) {
        while (hit != last_hit && !holds_node[hit->component].load(std::memory_order_relaxed)) ++hit;
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
    const TrianglesByLayer over(points, triangles);
    const Uprights& uprights = sides.uprights();
    if (over.empty() && uprights.empty()) return {{}, std::vector<char>(components, 0)};
    const int low_x = over.empty()       ? uprights.low_x()
                      : uprights.empty() ? over.low_x()
                                         : std::min(over.low_x(), uprights.low_x());
    const int end_x =
        std::max(over.empty() ? low_x : over.end_x(), uprights.empty() ? low_x : uprights.end_x());

    std::vector<std::vector<Hit>> hits(static_cast<std::size_t>(end_x - low_x));
    std::vector<std::atomic<char>> holds_node(components);  // flagged by several threads
    tbb::parallel_for(low_x, end_x, [&](int x) {
        std::vector<Hit>& of_layer = hits[x - low_x];
        of_layer = hits_in_layer(x, over, points, triangles, component);
        std::vector<char> paired;
        const Hit *line = of_layer.data(), *end = line + of_layer.size();
        while (line != end) {
            const Hit* next = std::find_if(line, end, [&](const Hit& h) { return h.y != line->y; });
            flag_holders(line, next, paired, holds_node);
            line = next;
        }
    });
    std::vector<Layer> layers(hits.size());
    tbb::parallel_for(low_x, end_x, [&](int x) {
        std::vector<Hit>& of_layer = hits[x - low_x];
        layers[x - low_x] = merge(of_layer, holds_node, uprights.layer(x));
        std::vector<Hit>().swap(of_layer);
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
