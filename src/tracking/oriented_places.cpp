#include "tracking/oriented_places.h"

#include <CGAL/Dimension.h>
#include <CGAL/Kd_tree.h>
#include <CGAL/Orthogonal_k_neighbor_search.h>
#include <CGAL/Search_traits.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "parallel_for_each.h"
#include "surface/thread_probes.h"

namespace isotrack {
namespace {

constexpr std::size_t kMost = 4000;  // places

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

Key key_of(const Vec3& point, const Vec3& scaled_normal, int place) {
    return {{point.x(), point.y(), point.z(), scaled_normal.x(), scaled_normal.y(), scaled_normal.z()},
            place};
}

}  // namespace

struct OrientedPlaces::Tree {
    Search::Tree of_keys;
};

OrientedPlaces::OrientedPlaces(const Surface& surface, const CrossingGrid& crossings, double turn_length)
    : places_(std::min(crossings.size(), kMost)),
      normal_scale_(turn_length / std::sqrt(2.0)),
      tree_(std::make_unique<Tree>()) {
    ThreadProbes probes(surface);
    parallel_for_each(places_.size(), 256, [&](std::size_t i) {
        const Vec3 p = crossings[i * crossings.size() / places_.size()].point;
        places_[i] = {p, probes.local().normal(p)};
    });
    for (std::size_t i = 0; i < places_.size(); ++i)
        if (places_[i].normal.squaredNorm() > 0.0)
            tree_->of_keys.insert(
                key_of(places_[i].point, normal_scale_ * places_[i].normal, static_cast<int>(i)));
    if (!empty()) tree_->of_keys.build();  // now, not by the thread that asks first
}

OrientedPlaces::~OrientedPlaces() = default;

bool OrientedPlaces::empty() const {
    return size() == 0;
}

std::size_t OrientedPlaces::size() const {
    return tree_->of_keys.size();
}

const OrientedPlaces::Place& OrientedPlaces::nearest(const Vec3& point, const Vec3& normal) const {
    Search search(tree_->of_keys, key_of(point, normal_scale_ * normal, 0), 1);
    return places_[search.begin()->first.place];
}

}  // namespace isotrack
