#include "delaunay/living.h"

#include <CGAL/Delaunay_triangulation_3.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Triangulation_cell_base_with_info_3.h>
#include <CGAL/Triangulation_vertex_base_with_info_3.h>

#include <algorithm>
#include <chrono>
#include <utility>

namespace isotrack {
namespace {

struct Slot {
    int index = -1;  // of the flat copy; a new cell has none
};

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using VertexBase = CGAL::Triangulation_vertex_base_with_info_3<int, Kernel>;
using CellBase =
    CGAL::Triangulation_cell_base_with_info_3<Slot, Kernel, CGAL::Delaunay_triangulation_cell_base_3<Kernel>>;
using Delaunay =
    CGAL::Delaunay_triangulation_3<Kernel, CGAL::Triangulation_data_structure_3<VertexBase, CellBase>>;
using Cell = Delaunay::Cell_handle;
using Vertex = Delaunay::Vertex_handle;

Kernel::Point_3 to_cgal(const Vec3& p) {
    return {p.x(), p.y(), p.z()};
}

/// Counts a call and its time.
class Clocked {
public:
    explicit Clocked(UpdateProfile::Row& row) : row_(row), start_(std::chrono::steady_clock::now()) {
        ++row_.calls;
    }
    ~Clocked() {
        row_.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
    }

private:
    UpdateProfile::Row& row_;
    std::chrono::steady_clock::time_point start_;
};

}  // namespace

struct LivingDelaunay::Impl {
    Delaunay dt;
    UpdateProfile profile;
    std::vector<Vertex> vertex;  // by number
    Tetrahedra flat;
    bool mirrored = false;  // `flat` is that of `dt`
    std::vector<int> free_slots, changed;
    std::vector<Cell> cells, fresh;
    std::vector<std::pair<Cell, int>> rim;

    int number_of(Vertex v) const { return dt.is_infinite(v) ? Tetrahedra::kInfinite : v->info(); }

    void write(Cell cell) {
        const int s = cell->info().index;
        for (int k = 0; k < 4; ++k) {
            flat.vertices[s][k] = number_of(cell->vertex(k));
            flat.neighbours[s][k] = cell->neighbor(k)->info().index;
        }
    }

    void mirror() {
        flat.vertices.clear();
        flat.neighbours.clear();
        free_slots.clear();
        mirrored = true;
        changed.clear();
        if (dt.dimension() < 3) return;
        int count = 0;
        for (auto cell = dt.all_cells_begin(); cell != dt.all_cells_end(); ++cell)
            cell->info().index = count++;
        flat.vertices.resize(count);
        flat.neighbours.resize(count);
        changed.resize(count);
        for (auto cell = dt.all_cells_begin(); cell != dt.all_cells_end(); ++cell) {
            changed[cell->info().index] = cell->info().index;
            write(cell);
        }
    }

    void free_slot(Cell cell) {
        const int s = cell->info().index;
        flat.vertices[s].fill(Tetrahedra::kInfinite);
        flat.neighbours[s].fill(s);
        free_slots.push_back(s);
        changed.push_back(s);
    }

    /// Cells are the most of what a DT holds: twice the room for a few more would be too much.
    void add_slot() {
        constexpr std::size_t kSlack = 16;  // of as many
        if (flat.size() == flat.vertices.capacity()) {
            flat.vertices.reserve(flat.size() + flat.size() / kSlack + kSlack);
            flat.neighbours.reserve(flat.vertices.capacity());
        }
        flat.vertices.emplace_back();
        flat.neighbours.emplace_back();
    }

    /// Gives every cell in `fresh` a slot and writes it and its neighbours.
    void adopt() {
        for (const Cell& cell : fresh) {
            if (free_slots.empty()) {
                cell->info().index = static_cast<int>(flat.size());
                add_slot();
            } else {
                cell->info().index = free_slots.back();
                free_slots.pop_back();
            }
        }
        for (const Cell& cell : fresh) {
            write(cell);
            changed.push_back(cell->info().index);
            for (int k = 0; k < 4; ++k) {
                const Cell other = cell->neighbor(k);
                flat.neighbours[other->info().index][other->index(cell)] = cell->info().index;
            }
        }
    }

    Vertex insert(const Vec3& at, Vertex near) {
        const auto p = to_cgal(at);
        Delaunay::Locate_type type;
        int i, j;
        Cell start;
        {
            const Clocked clock(profile.locate);
            start = dt.locate(p, type, i, j, near == Vertex() ? Cell() : near->cell());
        }
        if (type == Delaunay::VERTEX) return Vertex();
        const Clocked clock(profile.insert);
        if (dt.dimension() < 3 || !mirrored || type == Delaunay::OUTSIDE_AFFINE_HULL) {
            mirrored = false;
            return dt.insert(p, type, start, i, j);
        }
        cells.clear();
        dt.find_conflicts(p, start, CGAL::Oneset_iterator<Delaunay::Facet>(facet), std::back_inserter(cells));
        for (const Cell& cell : cells) free_slot(cell);
        const Vertex v = dt.insert_in_hole(p, cells.begin(), cells.end(), facet.first, facet.second);
        fresh.clear();
        dt.incident_cells(v, std::back_inserter(fresh));
        return v;
    }
    Delaunay::Facet facet;

    void remove(Vertex v) {
        const Clocked clock(profile.remove);
        if (dt.dimension() < 3 || !mirrored) {
            mirrored = false;
            dt.remove(v);
            return;
        }
        cells.clear();
        rim.clear();
        dt.incident_cells(v, std::back_inserter(cells));
        for (const Cell& cell : cells) {
            const Cell other = cell->neighbor(cell->index(v));
            rim.emplace_back(other, other->index(cell));
        }
        for (const Cell& cell : cells) free_slot(cell);
        dt.remove(v);
        if (dt.dimension() < 3) {
            mirrored = false;
            return;
        }
        // The new cells fill the hole behind the rim; they are those without a slot.
        constexpr int kFound = -2;
        fresh.clear();
        const auto find = [&](Cell cell) {
            if (cell->info().index != -1) return;
            cell->info().index = kFound;
            fresh.push_back(cell);
        };
        for (const auto& [cell, k] : rim) find(cell->neighbor(k));
        for (std::size_t f = 0; f < fresh.size(); ++f)
            for (int k = 0; k < 4; ++k) find(fresh[f]->neighbor(k));
        adopt();
    }
};

LivingDelaunay::LivingDelaunay() : impl_(std::make_unique<Impl>()) {}
LivingDelaunay::~LivingDelaunay() = default;

void LivingDelaunay::assign(const std::vector<Vec3>& points, const std::vector<char>& there) {
    const Clocked clock(impl_->profile.build);
    std::vector<std::pair<Kernel::Point_3, int>> numbered;
    numbered.reserve(points.size());
    for (std::size_t i = 0; i < points.size(); ++i)
        if (there.empty() || there[i]) numbered.emplace_back(to_cgal(points[i]), static_cast<int>(i));
    impl_->dt.clear();
    impl_->dt.insert(numbered.begin(), numbered.end());
    impl_->vertex.assign(points.size(), Vertex());
    for (auto v = impl_->dt.finite_vertices_begin(); v != impl_->dt.finite_vertices_end(); ++v)
        impl_->vertex[v->info()] = v;
    impl_->mirrored = false;
}

bool LivingDelaunay::insert(int number, const Vec3& p, int near) {
    if (number >= static_cast<int>(impl_->vertex.size())) impl_->vertex.resize(number + 1);
    const Vertex v = impl_->insert(p, near >= 0 ? impl_->vertex[near] : Vertex());
    impl_->vertex[number] = v;
    if (v == Vertex()) return false;
    v->info() = number;
    if (impl_->mirrored) impl_->adopt();
    return true;
}

void LivingDelaunay::remove(int number) {
    impl_->remove(impl_->vertex[number]);
    impl_->vertex[number] = Vertex();
}

void LivingDelaunay::relocate(int number, const Vec3& p) {
    ++impl_->profile.relocated;
    const Vertex old = impl_->vertex[number];
    const Vertex v = impl_->insert(p, old);
    if (v != Vertex()) {
        v->info() = number;
        if (impl_->mirrored) impl_->adopt();
    }
    impl_->remove(old);
    impl_->vertex[number] = v;
}

void LivingDelaunay::renumber(const std::vector<int>& to) {
    std::vector<Vertex> vertex;
    for (std::size_t i = 0; i < impl_->vertex.size(); ++i) {
        if (to[i] < 0) continue;
        vertex.resize(to[i] + 1);
        vertex[to[i]] = impl_->vertex[i];
        if (vertex[to[i]] != Vertex()) vertex[to[i]]->info() = to[i];
    }
    impl_->vertex.swap(vertex);
    if (!impl_->mirrored) return;
    for (auto& cell : impl_->flat.vertices)
        for (int& v : cell)
            if (v >= 0) v = to[v];
}

std::size_t LivingDelaunay::size() const {
    return impl_->dt.number_of_vertices();
}

bool LivingDelaunay::has(int number) const {
    return number < static_cast<int>(impl_->vertex.size()) && impl_->vertex[number] != Vertex();
}

Vec3 LivingDelaunay::position(int number) const {
    const auto& p = impl_->vertex[number]->point();
    return {p.x(), p.y(), p.z()};
}

void LivingDelaunay::set_position(int number, const Vec3& p) {
    impl_->vertex[number]->set_point(to_cgal(p));
}

LivingDelaunay::Star LivingDelaunay::star_at(int number, const Vec3& p) {
    Delaunay& dt = impl_->dt;
    if (dt.dimension() < 3) return Star::Broken;
    const Clocked clock(impl_->profile.predicates);
    const Vertex v = impl_->vertex[number];
    const auto before = v->point();
    v->set_point(to_cgal(p));
    auto& cells = impl_->cells;
    cells.clear();
    dt.incident_cells(v, std::back_inserter(cells));
    Star star = Star::Delaunay;
    for (const Cell& c : cells)
        if (!dt.is_infinite(c) &&
            CGAL::orientation(c->vertex(0)->point(), c->vertex(1)->point(), c->vertex(2)->point(),
                              c->vertex(3)->point()) != CGAL::POSITIVE) {
            star = Star::Broken;
            break;
        }
    // Every facet of the star's cells, the link's among them: neither apex inside the other's sphere. Between
    // two infinite cells that is the convexity of the hull: where it is dented a cell is missing, but all
    // that are there are embedded.
    for (std::size_t f = 0; f < cells.size() && star == Star::Delaunay; ++f)
        for (int k = 0; k < 4 && star == Star::Delaunay; ++k) {
            const Cell c = cells[f], other = c->neighbor(k);
            const Vertex apex = other->vertex(other->index(c));
            if (!dt.is_infinite(apex) && dt.side_of_sphere(c, apex->point()) == CGAL::ON_BOUNDED_SIDE)
                star = Star::EmbeddedOnly;
        }
    v->set_point(before);
    return star;
}

void LivingDelaunay::neighbours(int number, std::vector<int>& result) const {
    result.clear();
    if (!has(number) || impl_->dt.dimension() < 3) return;
    std::vector<Vertex> found;
    impl_->dt.finite_adjacent_vertices(impl_->vertex[number], std::back_inserter(found));
    for (const Vertex& v : found) result.push_back(v->info());
}

const Tetrahedra& LivingDelaunay::cells() {
    if (!impl_->mirrored) impl_->mirror();
    return impl_->flat;
}

std::vector<int> LivingDelaunay::take_changed() {
    cells();
    std::vector<int> changed = std::exchange(impl_->changed, {});
    if (!std::is_sorted(changed.begin(), changed.end())) std::sort(changed.begin(), changed.end());
    changed.erase(std::unique(changed.begin(), changed.end()), changed.end());
    return changed;
}

const UpdateProfile& LivingDelaunay::profile() const {
    return impl_->profile;
}

}  // namespace isotrack
