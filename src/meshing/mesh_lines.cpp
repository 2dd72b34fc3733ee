#include "meshing/mesh_lines.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>
#include <tuple>
#include <utility>

#include "meshing/lattice_lines.h"

namespace isotrack {
namespace {

/// The lines run a hair beside the nodes, so that they miss the vertices and edges of meshes that are aligned
/// with the lattice.
constexpr double kBeside[2] = {1.3e-7, 2.9e-7};

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
std::vector<MeshLines::Hit> hits_in_layer(int x, const TrianglesByLayer& over,
                                          const std::vector<Vec3>& points,
                                          const std::vector<Triangle>& triangles,
                                          const std::vector<int>& component) {
    std::vector<MeshLines::Hit> hits;
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

}  // namespace

MeshLines::MeshLines(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                     const std::vector<int>& component, int components) {
    const TrianglesByLayer over(points, triangles);
    low_x_ = over.low_x();
    layers_.resize(static_cast<std::size_t>(over.end_x() - low_x_));
    std::vector<std::atomic<char>> holds_node(components);  // flagged by several threads
    tbb::parallel_for(std::size_t{0}, layers_.size(), [&](std::size_t l) {
        std::vector<Hit>& hits = layers_[l];
        hits = hits_in_layer(low_x_ + static_cast<int>(l), over, points, triangles, component);
        const Hit *line = hits.data(), *end = line + hits.size();
        while (line != end) {
            const Hit* next = std::find_if(line, end, [&](const Hit& h) { return h.y != line->y; });
            for_each_pair({line, next}, [&](const Hit& in, const Hit& out) {
                if (std::floor(out.z) >= in.z) holds_node[in.component].store(1, std::memory_order_relaxed);
            });
            line = next;
        }
    });
    holds_node_.assign(holds_node.begin(), holds_node.end());
}

MeshLines::Range MeshLines::layer(int x) const {
    if (x < low_x() || x >= end_x()) return {nullptr, nullptr};
    const std::vector<Hit>& hits = layers_[x - low_x_];
    return {hits.data(), hits.data() + hits.size()};
}

MeshLines::Range MeshLines::line(int x, int y) const {
    const auto [begin, end] = layer(x);
    const Hit* first = std::partition_point(begin, end, [&](const Hit& h) { return h.y < y; });
    return {first, std::partition_point(first, end, [&](const Hit& h) { return h.y == y; })};
}

}  // namespace isotrack
