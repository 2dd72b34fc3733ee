#include "meshing/replacing.h"

#include <algorithm>
#include <utility>

#include "meshing/stands_for.h"
#include "meshing/triangle_box.h"

namespace isotrack {
namespace {

/// The least of some triangles.
double facing_of(const std::vector<Places>& some, Surface::Probe& probe) {
    double least = 1.0;
    for (const auto& [a, b, c] : some) least = std::min(least, facing(a, b, c, probe));
    return least;
}

}  // namespace

Replaced ReplaceableMesh::replaced(std::vector<int> numbers, std::vector<int> beside,
                                   Surface::Probe& probe) const {
    Replaced result;
    std::vector<Places> old;
    old.reserve(numbers.size());  // here and below: threads wait for each other where blocks are taken
    result.triangles.reserve(numbers.size());
    for (const int number : numbers) {
        old.push_back(places_of(triangles[number]));
        const auto& [a, b, c] = old.back();
        result.triangles.emplace_back(a, b, c);
        result.box.extend(box_of(points, triangles[number]));
    }
    result.facing = facing_of(old, probe);
    std::sort(numbers.begin(), numbers.end());
    std::sort(beside.begin(), beside.end());
    beside.erase(std::unique(beside.begin(), beside.end()), beside.end());
    result.beside.reserve(beside.size());
    for (const int number : beside) {
        if (std::binary_search(numbers.begin(), numbers.end(), number)) continue;
        const auto [a, b, c] = places_of(triangles[number]);
        result.beside.emplace_back(a, b, c);
    }
    return result;
}

bool ReplaceableMesh::may_have(const std::vector<Places>& candidates, const Replaced& before,
                               Surface::Probe& probe) const {
    // What costs least and fails most comes first.
    const double least_facing = std::min(kFacing, before.facing);
    const auto faces = [&](const Places& t) {
        const auto& [a, b, c] = t;
        return facing(a, b, c, probe) > least_facing;
    };
    if (!std::all_of(candidates.begin(), candidates.end(), faces)) return false;
    std::vector<FacingTriangle> after;
    after.reserve(candidates.size());
    for (const auto& [a, b, c] : candidates) after.emplace_back(a, b, c);
    const auto stand_there = [&](const CrossingGrid* points_there) {
        return stand_for_same(*points_there, before.triangles, before.box, after, before.beside, tolerance);
    };
    if (!std::all_of(reached.begin(), reached.end(), stand_there)) return false;
    const auto passes = [&](const Places& t) {
        const auto& [a, b, c] = t;
        const TriangleError error = certified_error(a, b, c, probe, detail, 0.5 * tolerance, tolerance);
        return error.largest <= tolerance && error.turned_deg <= kMostTurnedDeg;
    };
    return std::all_of(candidates.begin(), candidates.end(), passes);
}

}  // namespace isotrack
