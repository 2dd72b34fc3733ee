// What two meshes have in common.
#include "tracking/facets.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <mutex>
#include <random>
#include <vector>

namespace isotrack {
namespace {

struct Keyed {
    int key, kind;
    bool operator==(const Keyed& o) const { return key >= 0 && key == o.key && kind == o.kind; }
};
using Found = std::vector<std::array<std::size_t, 2>>;

/// Holds what `compare` says against a search of each facet by its key.
void expect_right(const std::vector<Keyed>& now, const std::vector<Keyed>& before) {
    Found same, truly_same;
    std::mutex mutex;
    const FacetDifference found = compare(now, before, [&](std::size_t f, std::size_t old) {
        const std::lock_guard lock(mutex);
        same.push_back({f, old});
    });
    std::map<int, std::size_t> place;
    for (std::size_t old = 0; old < before.size(); ++old)
        if (before[old].key >= 0) place[before[old].key] = old;
    std::vector<std::size_t> came;
    std::vector<char> stays(before.size(), 0);
    for (std::size_t f = 0; f < now.size(); ++f) {
        const auto at = now[f].key < 0 ? place.end() : place.find(now[f].key);
        if (at == place.end() || before[at->second].kind != now[f].kind) {
            came.push_back(f);
            continue;
        }
        truly_same.push_back({f, at->second});
        stays[at->second] = 1;
    }
    std::vector<std::size_t> went;
    for (std::size_t old = 0; old < before.size(); ++old)
        if (!stays[old]) went.push_back(old);
    std::sort(same.begin(), same.end());
    EXPECT_EQ(same, truly_same);
    EXPECT_EQ(found.came, came);
    EXPECT_EQ(found.went, went);
}

TEST(Facets, AreComparedByTheirKeys) {
    std::mt19937 random(7);
    const auto chance = [&](double share) { return std::bernoulli_distribution(share)(random); };
    for (const double share : {0.0, 0.01, 0.3, 1.0}) {  // of those that came, that went, and without a key
        std::vector<Keyed> now, before;
        for (int key = 0; key < 50000; ++key) {
            while (share < 1.0 && chance(share)) (chance(0.5) ? now : before).push_back({-1, 0});
            if (!chance(share)) now.push_back({key, 0});
            if (!chance(share)) before.push_back({key, chance(share) ? 1 : 0});
        }
        expect_right(now, before);
        expect_right(now, {});
        expect_right({}, before);
        now.insert(now.end(), 9000, {-1, 0});
        before.insert(before.begin(), 9000, {-1, 0});
        expect_right(now, before);
    }
}

TEST(Facets, AreTheSameByTheirCornersWhereTheyHaveNoKey) {
    const auto facet = [](float x) {
        return Facet{-1, {Eigen::Vector3f(x, 0, 0), Eigen::Vector3f(x, 1, 0), Eigen::Vector3f(x, 0, 1)}};
    };
    const std::vector<Facet> came = {facet(4), facet(1), facet(3)},
                             went = {facet(2), facet(3), facet(4), facet(5)};
    auto same = same_corners(came, went);
    std::sort(same.begin(), same.end());
    const std::vector<std::array<std::size_t, 2>> expected = {{0, 2}, {2, 1}};
    EXPECT_EQ(same, expected);
    EXPECT_TRUE(same_corners(came, {}).empty());
}

}  // namespace
}  // namespace isotrack
