#include "tracking/oriented_places.h"

#include <CGAL/Dimension.h>
#include <CGAL/Kd_tree.h>
#include <CGAL/Orthogonal_k_neighbor_search.h>
#include <CGAL/Search_traits.h>

#include <array>
#include <cmath>

#include "parallel_for_each.h"
#include "surface/thread_probes.h"

namespace isotrack {
namespace {

constexpr std::size_t kMost = 3000;  // places

struct Key {
    std::array<double, 6> at;
    int place;
};
struct Coordinates {
    using result_type = const double*;
    const double* operator()(const Key& key) const { return key.at.data(); }
    const double* operator()(const Key& key, int) const { return key.at.data() + 6; }
};
using Traits = CGAL::Search_traits<double, Key, const double*, Coordinates, CGAL::Dimension_tag<6>>;
using Search = CGAL::Orthogonal_k_neighbor_search<Traits>;

Key key_of(const Vec3& point, const Vec3& turned, int place) {
    return {{point.x(), point.y(), point.z(), turned.x(), turned.y(), turned.z()}, place};
}

}  // namespace

struct OrientedPlaces::Tree {
    Search::Tree of_keys;
};

OrientedPlaces::OrientedPlaces(const Surface& surface, const CrossingGrid& crossings, double turn_length)
    : turned_(turn_length / std::sqrt(2.0)), tree_(std::make_unique<Tree>()) {
    const std::size_t step = 1 + crossings.size() / kMost;
    places_.resize((crossings.size() + step - 1) / step);
    ThreadProbes probes(surface);
    parallel_for_each(places_.size(), 256, [&](std::size_t i) {
        const Vec3 p = crossings[i * step].point;
        places_[i] = {p, probes.local().normal(p)};
    });
    for (std::size_t i = 0; i < places_.size(); ++i)
        if (!places_[i].normal.isZero(0.0))
            tree_->of_keys.insert(key_of(places_[i].point, turned_ * places_[i].normal, static_cast<int>(i)));
    if (tree_->of_keys.size() == 0) places_.clear();
    tree_->of_keys.build();
}

OrientedPlaces::~OrientedPlaces() = default;

const OrientedPlaces::Place& OrientedPlaces::nearest(const Vec3& point, const Vec3& normal) const {
    Search search(tree_->of_keys, key_of(point, turned_ * normal, 0), 1);
    return places_[search.begin()->first.place];
}

}  // namespace isotrack
