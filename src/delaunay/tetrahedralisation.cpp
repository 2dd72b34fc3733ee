#include "isotrack/delaunay/tetrahedralisation.h"

#include <algorithm>
#include <utility>

#include "delaunay/living.h"
#include "delaunay/update_cost.h"
#include "numbers_below.h"
#include "room.h"

namespace isotrack {
namespace {

/// The paper's scores (4.3).
constexpr int kBroken = 2, kNotDelaunay = 1, kLimit = 4;

/// What all strategies share: the true positions, and the DT that follows them.
class Follower : public Tetrahedralisation {
public:
    void assign(const std::vector<Vec3>& points, int threads) override {
        points_ = points;
        there_.assign(points.size(), 1);
        dt_.assign(points, there_, threads);
        assigned();
    }
    void clear() override {
        points_ = {};
        there_ = {};
        dt_.clear();
        assigned();
    }
    void compact() override {
        settle();
        std::vector<int> to(points_.size(), -1);
        int count = 0;
        for (std::size_t v = 0; v < points_.size(); ++v) {
            if (!there_[v]) continue;
            points_[count] = points_[v];
            to[v] = count++;
        }
        if (count == static_cast<int>(points_.size())) return;
        points_.resize(count);
        there_.assign(count, 1);
        dt_.renumber(to);
        assigned();
    }
    const Tetrahedra& cells() override { return dt_.cells(); }
    std::vector<int> take_changed() override { return dt_.take_changed(); }
    const UpdateProfile& profile() const override { return dt_.profile(); }

protected:
    virtual void assigned() {}

    int note_insert(const Vec3& point) {
        ensure_room(points_);
        points_.push_back(point);
        ensure_room(there_);
        there_.push_back(1);
        return static_cast<int>(points_.size()) - 1;
    }

    /// The number of a vertex that is in the DT, `near` itself or none.
    int hint(int near) const { return near >= 0 && dt_.has(near) ? near : -1; }

    /// Brings a vertex to its true position: in place where the DT allows it.
    void follow(int v) {
        if (!dt_.has(v)) {
            dt_.insert(v, points_[v], -1);
        } else if (dt_.star_at(v, points_[v]) == LivingDelaunay::Star::Delaunay) {
            dt_.set_position(v, points_[v]);
        } else {
            dt_.relocate(v, points_[v]);
        }
    }

    /// Vertices left out because another was on their place, which may have gone since.
    void insert_left_out() {
        if (dt_.size() == static_cast<std::size_t>(std::count(there_.begin(), there_.end(), 1))) return;
        for (std::size_t v = 0; v < points_.size(); ++v)
            if (there_[v] && !dt_.has(static_cast<int>(v))) dt_.insert(static_cast<int>(v), points_[v], -1);
    }

    std::vector<Vec3> points_;  // by number
    std::vector<char> there_;
    LivingDelaunay dt_;
};

/// Every move is followed at once.
class MovedTetrahedralisation final : public Follower {
public:
    int insert(const Vec3& point, int near) override {
        const int v = note_insert(point);
        dt_.insert(v, point, hint(near));
        return v;
    }
    void move(int vertex, const Vec3& to) override {
        points_[vertex] = to;
        follow(vertex);
    }
    void remove(int vertex) override {
        there_[vertex] = 0;
        if (dt_.has(vertex)) dt_.remove(vertex);
    }
    void neighbours(int vertex, std::vector<int>& result) const override { dt_.neighbours(vertex, result); }
    void settle() override { insert_left_out(); }
};

/// A move is followed when the star has been wrong for too long.
class LazyTetrahedralisation final : public Follower {
public:
    int insert(const Vec3& point, int near) override {
        const int v = note_insert(point);
        score_.push_back(0);
        dt_.insert(v, point, hint(near));
        return v;
    }
    void move(int vertex, const Vec3& to) override {
        points_[vertex] = to;
        if (!dt_.has(vertex)) return;
        switch (dt_.star_at(vertex, to)) {
            case LivingDelaunay::Star::Delaunay:
                // The paper leaves this open; the score tells how far the positions are apart: now they
                // agree.
                dt_.set_position(vertex, to);
                score_[vertex] = 0;
                return;
            case LivingDelaunay::Star::EmbeddedOnly:
                score_[vertex] += kNotDelaunay;
                break;
            case LivingDelaunay::Star::Broken:
                score_[vertex] += kBroken;
        }
        if (score_[vertex] < kLimit) return;
        dt_.relocate(vertex, to);
        score_[vertex] = 0;
    }
    void remove(int vertex) override {
        there_[vertex] = 0;
        if (dt_.has(vertex)) dt_.remove(vertex);
    }
    void neighbours(int vertex, std::vector<int>& result) const override { dt_.neighbours(vertex, result); }
    void settle() override {
        for (std::size_t v = 0; v < points_.size(); ++v)
            if (there_[v] && dt_.has(static_cast<int>(v)) &&
                dt_.position(static_cast<int>(v)) != points_[v]) {
                follow(static_cast<int>(v));
                score_[v] = 0;
            }
        insert_left_out();
    }

private:
    void assigned() override { score_ = std::vector<int>(points_.size(), 0); }
    std::vector<int> score_;
};

/// Changes are noted, and made by `settle`: one by one while they are few, else by building anew.
class BatchedTetrahedralisation final : public Follower {
public:
    explicit BatchedTetrahedralisation(bool always_rebuild) : always_rebuild_(always_rebuild) {}

    int insert(const Vec3& point, int near) override {
        const int v = note_insert(point);
        near_.resize(points_.size(), -1);
        near_[v] = near;
        pending_.resize(points_.size(), 1);
        ++inserted_;
        return v;
    }
    void move(int vertex, const Vec3& to) override {
        if (points_[vertex] == to) return;
        points_[vertex] = to;
        moved_ += !pending_[vertex];
        pending_[vertex] = 1;
    }
    void remove(int vertex) override {
        there_[vertex] = 0;
        ++removed_;
        pending_[vertex] = 1;
    }
    void neighbours(int vertex, std::vector<int>& result) const override {
        dt_.neighbours(vertex, result);
        result.erase(std::remove_if(result.begin(), result.end(), [&](int w) { return !there_[w]; }),
                     result.end());
    }

    void settle() override {
        if (inserted_ + moved_ + removed_ == 0) return;
        if (always_rebuild_ || building_pays(inserted_, moved_, removed_, dt_.size()))
            dt_.assign(points_, there_, 0);
        else
            update();
        assigned();
    }

private:
    void assigned() override {
        pending_ = std::vector<char>(points_.size(), 0);
        near_ = std::vector<int>(points_.size(), -1);
        inserted_ = moved_ = removed_ = 0;
    }

    void update() {
        for (std::size_t i = 0; i < points_.size(); ++i) {
            if (!pending_[i]) continue;
            const int v = static_cast<int>(i);
            if (!there_[v]) {
                if (dt_.has(v)) dt_.remove(v);
            } else if (dt_.has(v)) {
                follow(v);
            } else {
                dt_.insert(v, points_[v], hint(near_[v]));
            }
        }
        insert_left_out();
    }

    bool always_rebuild_;
    std::vector<char> pending_;
    std::vector<int> near_;
    std::size_t inserted_ = 0, moved_ = 0, removed_ = 0;
};

}  // namespace

Tetrahedra tetrahedralise(const std::vector<Vec3>& points) {
    IncrementalDelaunay dt;
    dt.points = points;
    std::vector<int> all = numbers_below(points.size());
    dt.build(all, 0);
    dt.arrange();
    return std::move(dt.slots());
}

Adjacency vertex_adjacency(const Tetrahedra& cells, std::size_t count) {
    std::vector<std::pair<int, int>> pairs;
    pairs.reserve(12 * cells.size());
    for (const auto& cell : cells.vertices)
        for (const int v : cell)
            for (const int w : cell)
                if (v >= 0 && w >= 0 && v != w) pairs.emplace_back(v, w);
    return from_pairs(pairs, count);
}

const char* name_of(UpdateStrategy strategy) {
    switch (strategy) {
        case UpdateStrategy::Rebuild:
            return "rebuild";
        case UpdateStrategy::Move:
            return "move";
        case UpdateStrategy::Lazy:
            return "lazy";
        default:
            return "auto";
    }
}

std::unique_ptr<Tetrahedralisation> make_tetrahedralisation(UpdateStrategy strategy) {
    switch (strategy) {
        case UpdateStrategy::Move:
            return std::make_unique<MovedTetrahedralisation>();
        case UpdateStrategy::Lazy:
            return std::make_unique<LazyTetrahedralisation>();
        default:
            return std::make_unique<BatchedTetrahedralisation>(strategy == UpdateStrategy::Rebuild);
    }
}

}  // namespace isotrack
