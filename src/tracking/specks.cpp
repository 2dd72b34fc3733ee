#include "tracking/specks.h"

#include <algorithm>
#include <map>
#include <queue>
#include <set>
#include <tuple>
#include <utility>

#include "sampling/compact.h"
#include "surface/far_value.h"
#include "tracking/cell_centroid.h"
#include "tracking/patching.h"

namespace isotrack {
namespace {

constexpr std::size_t kMostSpecks = 12;   // that are joined; each takes some meshes
constexpr std::size_t kMostCells = 4096;  // of a part, and met on ways from it

/// The inside cells that hang together with one.
std::set<int> inside_with(int cell, const CellLabels& labels, const Tetrahedra& cells) {
    std::set<int> result{cell};
    std::vector<int> stack{cell};
    while (!stack.empty() && result.size() < kMostCells) {
        const int c = stack.back();
        stack.pop_back();
        for (int k = 0; k < 4; ++k) {
            const int next = cells.neighbour(c, k);
            if (labels[next] != 0 && result.insert(next).second) stack.push_back(next);
        }
    }
    return result;
}

/// The outside cells on the way from a part to any other inside cell on which the largest distance outside is
/// least, then their number; none if there is no way within `farthest`.
std::vector<int> way_from(const std::set<int>& part, const CellLabels& labels, const Tetrahedra& cells,
                          const Particles& particles, const Surface& surface, double farthest) {
    const auto probe = surface.probe();
    struct Step {
        double distance;
        int steps, cell, from;
        bool operator>(const Step& o) const {
            return std::tie(distance, steps, cell, from) > std::tie(o.distance, o.steps, o.cell, o.from);
        }
    };
    std::priority_queue<Step, std::vector<Step>, std::greater<>> open;
    std::map<int, int> from;  // of the cells that were reached; -1 from the part
    const auto go_on = [&](int cell, double so_far, int steps) {
        for (int k = 0; k < 4; ++k) {
            const int next = cells.neighbour(cell, k);
            if (labels[next] != 0 || cells.is_infinite(next) || from.count(next) > 0) continue;
            const double distance = std::max(
                so_far, far_value(*probe, centroid_of(next, cells, particles), surface.resolution()));
            if (distance <= farthest) open.push({distance, steps + 1, next, steps == 0 ? -1 : cell});
        }
    };
    for (const int c : part) go_on(c, 0.0, 0);
    while (!open.empty() && from.size() < kMostCells) {
        const Step step = open.top();
        open.pop();
        if (!from.emplace(step.cell, step.from).second) continue;
        for (int k = 0; k < 4; ++k) {
            const int next = cells.neighbour(step.cell, k);
            if (labels[next] == 0 || part.count(next) > 0) continue;
            std::vector<int> way;
            for (int c = step.cell; c >= 0; c = from.at(c)) way.push_back(c);
            return way;
        }
        go_on(step.cell, step.distance, step.steps);
    }
    return {};
}

/// Takes the flags off what hangs together, within flagged triangles, with some of them.
void spare_components_of(const std::vector<std::size_t>& some, const FrameMesh& mesh,
                         std::vector<char>& flags) {
    std::vector<char> spared(mesh.vertices.size(), 0);
    const auto spare = [&](std::size_t t) {
        flags[t] = 0;
        for (const int v : mesh.carved.triangles[t]) spared[v] = 1;
    };
    for (const std::size_t t : some) spare(t);
    for (bool more = !some.empty(); more;) {
        more = false;
        for (std::size_t t = 0; t < flags.size(); ++t) {
            const auto& [i, j, k] = mesh.carved.triangles[t];
            if (!flags[t] || !(spared[i] || spared[j] || spared[k])) continue;
            spare(t);
            more = true;
        }
    }
}

/// Takes the flags off the components with a triangle whose box is within `distance` of one of `places`.
/// Returns whether there were any.
bool spare_near(const std::vector<Surface::Crossing>& places, double distance, const FrameMesh& mesh,
                std::vector<char>& flags) {
    std::vector<std::size_t> near;
    for (std::size_t t = 0; t < flags.size(); ++t) {
        if (!flags[t]) continue;
        Box box;
        for (const int v : mesh.carved.triangles[t]) box.extend(mesh.vertices[v]);
        if (std::any_of(places.begin(), places.end(),
                        [&](const auto& c) { return box.exteriorDistance(c.point) <= distance; }))
            near.push_back(t);
    }
    spare_components_of(near, mesh, flags);
    return !near.empty();
}

/// Flags the triangles of one speck after the other, as many as are looked at.
std::vector<std::vector<char>> each_speck(const FrameMesh& mesh, const std::vector<char>& speck) {
    std::vector<std::vector<char>> result;
    std::vector<char> left = speck;
    for (auto first = left.begin();
         (first = std::find(first, left.end(), 1)) != left.end() && result.size() < kMostSpecks;) {
        std::vector<char> flags = left;
        spare_components_of({static_cast<std::size_t>(first - left.begin())}, mesh, left);
        for (std::size_t t = 0; t < flags.size(); ++t) flags[t] = flags[t] && !left[t];
        result.push_back(std::move(flags));
    }
    return result;
}

struct Rest {
    FrameMesh mesh;
    Inspection inspection;
    std::vector<Surface::Crossing> newly_missed;
};

Rest without_and_inspected(const std::vector<char>& specks, const FrameMesh& mesh, Inspector& inspector) {
    Rest rest{without(mesh, specks), {}, {}};
    rest.inspection = inspector.inspect_both_ways(rest.mesh);
    inspector.look_between(rest.mesh, rest.inspection);
    rest.newly_missed = inspector.newly_missed(rest.inspection, mesh.vertices, mesh.carved.triangles);
    return rest;
}

bool any(const std::vector<char>& flags) {
    return std::find(flags.begin(), flags.end(), 1) != flags.end();
}

}  // namespace

std::size_t join_specks(MeshTrials& trials, CellLabels& labels, const Carve& carve, const Tetrahedra& cells,
                        const Particles& particles, const Surface& surface, const SizingLimits& limits) {
    // Those that something is near to which is missed without all of them.
    const auto needed = [&] {
        std::vector<char> specks = trials.topology().speck, removed = specks;
        if (!any(specks)) return specks;
        const Rest rest = without_and_inspected(specks, trials.mesh(), trials.inspector());
        spare_near(rest.newly_missed, limits.tolerance, trials.mesh(), removed);
        trials.inspector().inspect_both_ways(trials.mesh());
        for (std::size_t t = 0; t < specks.size(); ++t) specks[t] = specks[t] && !removed[t];
        return specks;
    };
    const auto join = [&](const std::set<int>& part) {
        CellLabels changed = labels;
        const auto way = way_from(part, changed, cells, particles, surface, limits.tolerance);
        if (way.empty()) return false;
        for (const int c : way) changed[c] = 1;
        FrameMesh other = carve(changed);
        const MeshNumbers now = numbers_of(trials.mesh()), then = numbers_of(other);
        if (then.components != now.components - 1 || then.euler != now.euler - 2 ||
            !trials.try_mesh(std::move(other)))
            return false;
        labels = std::move(changed);
        return true;
    };
    std::size_t joined = 0;
    std::set<int> refused;  // inside cells
    for (bool more = true; more;) {
        more = false;
        for (const std::vector<char>& speck : each_speck(trials.mesh(), needed())) {
            const auto t = std::find(speck.begin(), speck.end(), 1) - speck.begin();
            const int inside = trials.mesh().carved.inside_cell(t);
            if (inside < 0 || refused.count(inside) > 0) continue;
            const std::set<int> part = inside_with(inside, labels, cells);
            if (part.size() < kMostCells && join(part)) {
                more = ++joined < kMostSpecks;  // the triangles are others now
                break;
            }
            refused.insert(part.begin(), part.end());
        }
    }
    trials.topology();
    return joined;
}

void remove_specks(FrameMesh& mesh, Inspection& inspection, Inspector& inspector,
                   const SizingLimits& limits) {
    std::vector<char> specks = inspection.topology.speck;
    if (!any(specks)) return;
    while (any(specks)) {
        Rest rest = without_and_inspected(specks, mesh, inspector);
        if (spare_near(rest.newly_missed, limits.tolerance, mesh, specks)) continue;
        mesh = std::move(rest.mesh);
        inspection = std::move(rest.inspection);
        return;
    }
    inspector.inspect_both_ways(mesh);  // what it saw last was another
}

}  // namespace isotrack
