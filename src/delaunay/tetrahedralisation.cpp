#include "isotrack/delaunay/tetrahedralisation.h"

#include <CGAL/Delaunay_triangulation_3.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Triangulation_cell_base_with_info_3.h>
#include <CGAL/Triangulation_vertex_base_with_info_3.h>

#include <tbb/parallel_for.h>

#include <algorithm>
#include <utility>

namespace isotrack {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using VertexBase = CGAL::Triangulation_vertex_base_with_info_3<int, Kernel>;
using CellBase = CGAL::Triangulation_cell_base_with_info_3<int, Kernel, CGAL::Delaunay_triangulation_cell_base_3<Kernel>>;
using Delaunay = CGAL::Delaunay_triangulation_3<Kernel, CGAL::Triangulation_data_structure_3<VertexBase, CellBase>>;

Tetrahedra flat_copy(const Delaunay& dt) {
    Tetrahedra result;
    if (dt.dimension() < 3) return result;
    int count = 0;
    for (auto cell = dt.all_cells_begin(); cell != dt.all_cells_end(); ++cell) cell->info() = count++;
    result.vertices.reserve(count);
    result.neighbours.reserve(count);
    for (auto cell = dt.all_cells_begin(); cell != dt.all_cells_end(); ++cell) {
        std::array<int, 4> v, n;
        for (int k = 0; k < 4; ++k) {
            v[k] = dt.is_infinite(cell->vertex(k)) ? Tetrahedra::kInfinite : cell->vertex(k)->info();
            n[k] = cell->neighbor(k)->info();
        }
        result.vertices.push_back(v);
        result.neighbours.push_back(n);
    }
    return result;
}

class RebuiltTetrahedralisation final : public Tetrahedralisation {
public:
    void assign(const std::vector<Vec3>& points) override {
        points_ = points;
        removed_.assign(points.size(), 0);
        settle();
    }
    int insert(const Vec3& point, int) override {
        points_.push_back(point);
        removed_.push_back(0);
        return static_cast<int>(points_.size()) - 1;
    }
    void move(int vertex, const Vec3& to) override { points_[vertex] = to; }
    void remove(int vertex) override { removed_[vertex] = 1; }

    void neighbours(int vertex, std::vector<int>& result) const override {
        result.clear();
        if (vertex >= static_cast<int>(adjacency_.size())) return;  // not there at the last settle
        for (const int w : adjacency_.of(vertex))
            if (!removed_[w]) result.push_back(w);
    }

    void settle() override {
        std::vector<Vec3> points;
        std::vector<int> number;
        for (std::size_t i = 0; i < points_.size(); ++i)
            if (!removed_[i]) {
                points.push_back(points_[i]);
                number.push_back(static_cast<int>(i));
            }
        cells_ = tetrahedralise(points);
        for (auto& cell : cells_.vertices)
            for (int& v : cell)
                if (v >= 0) v = number[v];
        adjacency_ = vertex_adjacency(cells_, points_.size());
    }
    const Tetrahedra& cells() const override { return cells_; }
    std::size_t relocated() const override { return 0; }

private:
    std::vector<Vec3> points_;
    std::vector<char> removed_;
    Tetrahedra cells_;
    Adjacency adjacency_;
};

}  // namespace

Tetrahedra tetrahedralise(const std::vector<Vec3>& points) {
    std::vector<std::pair<Kernel::Point_3, int>> numbered;
    numbered.reserve(points.size());
    for (std::size_t i = 0; i < points.size(); ++i)
        numbered.emplace_back(Kernel::Point_3(points[i].x(), points[i].y(), points[i].z()), static_cast<int>(i));
    const Delaunay dt(numbered.begin(), numbered.end());
    return flat_copy(dt);
}

Adjacency vertex_adjacency(const Tetrahedra& cells, std::size_t count) {
    // First every pair of every cell, with repeats, then each list sorted and made unique in its place.
    std::vector<int> first(count + 1, 0);
    for (const auto& cell : cells.vertices)
        for (const int v : cell)
            if (v >= 0) first[v + 1] += 3;
    for (std::size_t i = 0; i < count; ++i) first[i + 1] += first[i];
    std::vector<int> pairs(first[count]), end(first.begin(), first.end() - 1);
    for (const auto& cell : cells.vertices)
        for (const int v : cell)
            for (const int w : cell)
                if (v >= 0 && w >= 0 && v != w) pairs[end[v]++] = w;
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 1024), [&](const auto& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
            const auto from = pairs.begin() + first[i];
            std::sort(from, pairs.begin() + end[i]);
            end[i] = static_cast<int>(std::unique(from, pairs.begin() + end[i]) - pairs.begin());
        }
    });
    Adjacency result;
    result.first.reserve(count + 1);
    for (std::size_t i = 0; i < count; ++i) {
        result.adjacent.insert(result.adjacent.end(), pairs.begin() + first[i], pairs.begin() + end[i]);
        result.first.push_back(static_cast<int>(result.adjacent.size()));
    }
    return result;
}

const char* name_of(UpdateStrategy) { return "rebuild"; }

std::unique_ptr<Tetrahedralisation> make_tetrahedralisation(UpdateStrategy) {
    return std::make_unique<RebuiltTetrahedralisation>();
}

}  // namespace isotrack
