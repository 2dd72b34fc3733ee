#include "delaunay/living.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

#include "delaunay/filters.h"
#include "numbers_below.h"
#include "room.h"

namespace isotrack {
namespace {

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

/// A facet of a cell by its vertices, from the smallest number on, counter-clockwise seen from outside.
using FacetKey = std::array<int, 3>;
FacetKey facet_of(const std::array<int, 4>& v, int k) {
    const auto& f = Tetrahedra::kFacet[k];
    FacetKey key{v[f[0]], v[f[1]], v[f[2]]};
    std::rotate(key.begin(), std::min_element(key.begin(), key.end()), key.end());
    return key;
}

}  // namespace

void LivingDelaunay::assign(const std::vector<Vec3>& points, const std::vector<char>& there, int threads) {
    dt_.points.clear();
    reserve_with_slack(dt_.points, points.size());
    dt_.points = points;
    there_ = there.empty() ? std::vector<char>(points.size(), 1) : there;
    rebuild(threads);
}

void LivingDelaunay::clear() {
    const UpdateProfile profile = profile_;
    *this = {};
    profile_ = profile;
}

void LivingDelaunay::rebuild(int threads) {
    const Clocked clock(profile_.build);
    std::vector<int> numbers;
    for (std::size_t v = 0; v < there_.size(); ++v)
        if (there_[v]) numbers.push_back(static_cast<int>(v));
    dt_.build(numbers, threads);
    dt_.arrange();
    size_ = numbers.size();
    std::fill(there_.begin(), there_.end(), 0);
    for (const int v : numbers) there_[v] = 1;
    a_cell_.assign(there_.size(), -1);
    const Tetrahedra& cells = dt_.cells();
    for (std::size_t c = 0; c < cells.size(); ++c)
        for (const int v : cells.vertices[c])
            if (v >= 0) a_cell_[v] = static_cast<int>(c);
    recent_ = 0;
    changed_ = numbers_below(cells.size());
}

bool LivingDelaunay::insert(int number, const Vec3& p, int near) {
    if (number >= static_cast<int>(there_.size())) {
        ensure_room(dt_.points);
        ensure_room(there_);
        ensure_room(a_cell_);
        dt_.points.resize(number + 1);
        there_.resize(number + 1, 0);
        a_cell_.resize(number + 1, -1);
    }
    dt_.points[number] = p;
    if (dt_.empty()) {
        there_[number] = 1;
        rebuild();
        return has(number);
    }
    int cell;
    {
        const Clocked clock(profile_.locate);
        cell = dt_.locate(p, near >= 0 ? a_cell_[near] : recent_);
    }
    if (dt_.vertex_at(p, cell) >= 0) return false;
    place(number, cell);
    return true;
}

/// Makes cells for a number that has a position, located in `cell`.
void LivingDelaunay::place(int number, int cell) {
    const Clocked clock(profile_.insert);
    dt_.insert(number, cell);
    for (const int slot : dt_.fresh())
        for (const int v : dt_.cells().vertices[slot])
            if (v >= 0) a_cell_[v] = slot;
    note(dt_.fresh());
    note(dt_.freed());
    recent_ = dt_.fresh().front();
    there_[number] = 1;
    ++size_;
}

/// Nobody may ever ask which slots changed.
void LivingDelaunay::note(const std::vector<int>& slots) {
    changed_.insert(changed_.end(), slots.begin(), slots.end());
    if (changed_.size() <= 2 * dt_.cells().size()) return;
    std::sort(changed_.begin(), changed_.end());
    changed_.erase(std::unique(changed_.begin(), changed_.end()), changed_.end());
}

void LivingDelaunay::remove(int number) {
    const Clocked clock(profile_.remove);
    there_[number] = 0;
    --size_;
    if (!dt_.empty() && !fill_star(number)) rebuild();
}

/// Fills what the cells around a vertex leave with cells of the DT of their other vertices (Devillers and
/// Teillaud 2011). False, and nothing done, when these span no volume.
bool LivingDelaunay::fill_star(int number) {
    const std::vector<int>& star = star_of(number);
    Tetrahedra& cells = dt_.slots();
    std::vector<int> link;
    for (const int c : star)
        for (const int v : cells.vertices[c])
            if (v >= 0 && v != number) link.push_back(v);
    std::sort(link.begin(), link.end());
    link.erase(std::unique(link.begin(), link.end()), link.end());
    hole_.points.clear();
    for (const int v : link) hole_.points.push_back(dt_.points[v]);
    std::vector<int> all = numbers_below(link.size());
    hole_.build(all, 1);
    const Tetrahedra& filling = hole_.cells();

    // From outside the star every facet of its rim is found again among those of the filling.
    struct Entry {
        FacetKey facet;
        int link;  // to the cell of the filling that has it
        bool operator<(const Entry& other) const { return facet < other.facet; }
    };
    std::vector<Entry> entries;
    for (std::size_t c = 0; c < filling.size(); ++c) {
        std::array<int, 4> v = filling.vertices[c];
        for (int& w : v)
            if (w >= 0) w = link[w];
        for (int k = 0; k < 4; ++k)
            entries.push_back({facet_of(v, k), Tetrahedra::link(static_cast<int>(c), k)});
    }
    std::sort(entries.begin(), entries.end());
    constexpr int kNone = -1;
    std::vector<std::array<int, 4>> outside(filling.size(), {kNone, kNone, kNone, kNone});
    std::vector<int> taken, slot(filling.size(), kNone);
    for (const int c : star) {
        const int k = cells.index_of(c, number);
        const Entry entry{facet_of(cells.vertices[c], k), kNone};
        const auto found = std::lower_bound(entries.begin(), entries.end(), entry);
        if (found == entries.end() || found->facet != entry.facet) return false;
        const int inside = found->link >> 2;
        outside[inside][found->link & 3] = cells.links[c][k];
        if (slot[inside] == kNone) taken.push_back(inside);
        slot[inside] = 0;
    }
    for (std::size_t i = 0; i < taken.size(); ++i)
        for (int k = 0; k < 4; ++k) {
            const int next = filling.neighbour(taken[i], k);
            if (outside[taken[i]][k] != kNone || slot[next] != kNone) continue;
            taken.push_back(next);
            slot[next] = 0;
        }

    note(star);
    for (const int c : star) dt_.free_slot(c);
    std::vector<int> fresh;
    for (const int c : taken) fresh.push_back(slot[c] = dt_.new_slot());
    note(fresh);
    recent_ = slot[taken.front()];
    for (const int c : taken) {
        const int s = slot[c];
        for (int k = 0; k < 4; ++k) {
            const int v = filling.vertices[c][k];
            cells.vertices[s][k] = v < 0 ? Tetrahedra::kInfinite : link[v];
            if (v >= 0) a_cell_[link[v]] = s;
            const int out = outside[c][k];
            if (out == kNone) {
                cells.links[s][k] =
                    Tetrahedra::link(slot[filling.neighbour(c, k)], filling.mirror_index(c, k));
            } else {
                cells.links[s][k] = out;
                cells.links[out >> 2][out & 3] = Tetrahedra::link(s, k);
            }
        }
    }
    return true;
}

void LivingDelaunay::relocate(int number, const Vec3& p) {
    ++profile_.relocated;
    if (dt_.empty()) {
        dt_.points[number] = p;
        rebuild();
        return;
    }
    int cell;
    {
        const Clocked clock(profile_.locate);
        cell = dt_.locate(p, a_cell_[number]);
    }
    const int other = dt_.vertex_at(p, cell);
    if (other == number) return;
    if (other >= 0) {
        remove(number);
        return;
    }
    // Under a number of its own until the old one has gone.
    const int moved = static_cast<int>(there_.size());
    ensure_room(dt_.points);
    ensure_room(there_);
    ensure_room(a_cell_);
    dt_.points.push_back(p);
    there_.push_back(0);
    a_cell_.push_back(-1);
    place(moved, cell);
    remove(number);
    for (const int c : star_of(moved)) dt_.slots().vertices[c][dt_.cells().index_of(c, moved)] = number;
    dt_.points[number] = p;
    there_[number] = 1;
    a_cell_[number] = a_cell_[moved];
    dt_.points.pop_back();
    there_.pop_back();
    a_cell_.pop_back();
}

void LivingDelaunay::renumber(const std::vector<int>& to) {
    std::size_t count = 0;
    for (std::size_t v = 0; v < there_.size(); ++v) {
        if (to[v] < 0) continue;
        count = to[v] + 1;
        dt_.points[to[v]] = dt_.points[v];
        there_[to[v]] = there_[v];
        a_cell_[to[v]] = a_cell_[v];
    }
    dt_.points.resize(count);
    there_.resize(count);
    a_cell_.resize(count);
    for (auto& cell : dt_.slots().vertices)
        for (int& v : cell)
            if (v >= 0) v = to[v];
}

/// The cells around a vertex; valid until the next call.
const std::vector<int>& LivingDelaunay::star_of(int number) const {
    const Tetrahedra& cells = dt_.cells();
    star_.clear();
    if (cells.size() == 0) return star_;
    in_star_.resize(cells.size(), 0);
    star_.push_back(a_cell_[number]);
    in_star_[star_.front()] = 1;
    for (std::size_t i = 0; i < star_.size(); ++i)
        for (int k = 0; k < 4; ++k) {
            const int other = cells.neighbour(star_[i], k);
            if (cells.vertices[star_[i]][k] == number || in_star_[other]) continue;
            in_star_[other] = 1;
            star_.push_back(other);
        }
    for (const int c : star_) in_star_[c] = 0;
    return star_;
}

LivingDelaunay::Star LivingDelaunay::star_at(int number, const Vec3& p) {
    if (dt_.empty()) return Star::Broken;
    const Clocked clock(profile_.predicates);
    const Tetrahedra& cells = dt_.cells();
    const std::vector<Vec3>& at = dt_.points;
    const Vec3 before = std::exchange(dt_.points[number], p);
    const std::vector<int>& star = star_of(number);
    const auto upright = [&](int c) {
        const auto& v = cells.vertices[c];
        return cells.is_infinite(c) || filtered_orientation(at[v[0]], at[v[1]], at[v[2]], at[v[3]]) > 0;
    };
    // Every facet of the star's cells, the link's among them: neither apex inside the other's sphere. Between
    // two infinite cells that is the convexity of the hull: where it is dented a cell is missing, but all
    // that are there are embedded.
    const auto delaunay = [&](int c) {
        for (int k = 0; k < 4; ++k) {
            const int apex = cells.vertices[cells.neighbour(c, k)][cells.mirror_index(c, k)];
            if (apex >= 0 && dt_.in_conflict(c, at[apex])) return false;
        }
        return true;
    };
    Star result = Star::Delaunay;
    if (!std::all_of(star.begin(), star.end(), upright))
        result = Star::Broken;
    else if (!std::all_of(star.begin(), star.end(), delaunay))
        result = Star::EmbeddedOnly;
    dt_.points[number] = before;
    return result;
}

void LivingDelaunay::neighbours(int number, std::vector<int>& result) const {
    result.clear();
    if (!has(number)) return;
    for (const int c : star_of(number))
        for (const int v : dt_.cells().vertices[c])
            if (v >= 0 && v != number) result.push_back(v);
    std::sort(result.begin(), result.end());
    result.erase(std::unique(result.begin(), result.end()), result.end());
}

std::vector<int> LivingDelaunay::take_changed() {
    std::vector<int> changed = std::exchange(changed_, {});
    if (!std::is_sorted(changed.begin(), changed.end())) std::sort(changed.begin(), changed.end());
    changed.erase(std::unique(changed.begin(), changed.end()), changed.end());
    return changed;
}

}  // namespace isotrack
