#include "tracking/patches.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include "component_boxes.h"
#include "isotrack/meshing/self_intersections.h"
#include "meshing/patch.h"
#include "meshing/small_handles.h"
#include "numbers_below.h"
#include "sampling/compact.h"
#include "tracking/patch_batches.h"
#include "tracking/patching.h"

namespace isotrack {
namespace {

// All in resolutions.
constexpr double kFar = std::numeric_limits<double>::infinity();
constexpr double kSmall = 3.5;    // reach of the pieces of the mesh that are looked at
constexpr double kThin = 2.0;     // sheets no farther apart
constexpr double kNarrow = 3.0;   // likewise: mesh and lattice may join them differently
constexpr double kApart = 1.5;    // places that near are one
constexpr double kCovered = 2.0;  // so far apart they leave nothing out
constexpr double kAround = 2.5;   // the middles of other patches for what fails
constexpr double kReaches[] = {1.0, 1.5, 2.0, 2.7, kSmall, 4.7, 6.0, 8.0};
// How far around places the lattice is made, for patches there with the largest reach, or with `kSmall`.
constexpr double kTriedReach = 24.0, kLookReach = 4.0 * kSmall;
constexpr double kMostArea = 50000.0,
                 kMostAreaOfPlace = 50.0;  // square: what goes, for all patches, for one
constexpr std::size_t kFewPlaces = 30, kMostPlaces = 300, kMostWithLattice = 1000;
constexpr int kMostPatches = 1000, kMostTooFar = 50, kMostRefused = 50;  // see Effort
constexpr std::size_t kMostTriangles = 10000000;                         // of the whole meshes they make
constexpr double kLikelyShare = 0.8;            // of patches and area, for places that are likely
constexpr std::size_t kMostEverywhere = 20000;  // places all over a mesh
constexpr long kMostAstray = 30;  // components and handles: more are not found at less likely places
constexpr std::size_t kMostPairs = 100000000;  // of components

/// Where the topology of the mesh is another than the lattice's.
std::vector<Vec3> faulty_places(const FrameMesh& mesh, const LatticeTopology& topology, double resolution) {
    std::vector<Vec3> result = topology.faults;
    for (const auto& diagonal : topology.parted) result.push_back(0.5 * (diagonal.from + diagonal.to));
    for (std::size_t t = 0; t < topology.speck.size(); ++t)
        if (topology.speck[t]) result.push_back(mesh.vertices[mesh.carved.triangles[t][0]]);
    return apart(result, kApart * resolution);
}

/// There, and where it may be: at small handles of thin sheets unless there are very many.
std::vector<Vec3> suspicious_places(const FrameMesh& mesh, const std::vector<Vec3>& faulty,
                                    const std::vector<double>& thickness, double resolution) {
    std::vector<char> at_thin;
    for (const int p : mesh.carved.particle) at_thin.push_back(p >= 0 && thickness[p] < kThin * resolution);
    std::vector<Vec3> all = faulty;
    for (const int v : small_handles(mesh.vertices, mesh.carved.triangles, at_thin, kSmall * resolution))
        all.push_back(mesh.vertices[v]);
    all = apart(all, kApart * resolution);
    return all.size() > kMostPlaces ? faulty : all;
}

/// The small components of mesh or lattice that the other does not have.
std::vector<Vec3> unmatched_components(const FrameMesh& mesh, const std::vector<Box>& of_lattice,
                                       double resolution) {
    std::vector<Vec3> ours, theirs, result;
    const auto take_small = [&](const std::vector<Box>& boxes, std::vector<Vec3>& middles) {
        for (const Box& box : boxes)
            if (box.sizes().maxCoeff() < kSmall * resolution) middles.push_back(box.center());
    };
    take_small(component_boxes(mesh.vertices, mesh.carved.triangles).boxes, ours);
    take_small(of_lattice, theirs);
    if (ours.size() * theirs.size() > kMostPairs) return result;
    const auto take_unmatched = [&](const std::vector<Vec3>& some, const std::vector<Vec3>& others) {
        for (const Vec3& one : some)
            if (std::none_of(others.begin(), others.end(),
                             [&](const Vec3& other) { return (other - one).norm() < resolution; }))
                result.push_back(one);
    };
    take_unmatched(ours, theirs);
    take_unmatched(theirs, ours);
    return result;
}

/// Whether a patch crosses the rest of its mesh or itself.
bool crosses(const Patch& patch, const TriangleTree& mesh) {
    std::vector<Vec3> points = mesh.points();
    points.insert(points.end(), patch.points.begin(), patch.points.end());
    Box box;
    for (const Triangle& t : patch.triangles) box.extend(box_of(points, t));
    std::vector<Triangle> rest;
    for (const int t : mesh.meeting(box))
        if (!std::binary_search(patch.gone.begin(), patch.gone.end(), t)) rest.push_back(mesh.triangles()[t]);
    return any_cross(points, patch.triangles, rest);
}

double area_of(const std::vector<int>& triangles, const FrameMesh& mesh) {
    double twice = 0.0;
    for (const int t : triangles) twice += area_vector(mesh.carved.triangles[t], mesh.vertices).norm();
    return 0.5 * twice;
}

/// Small handles anywhere, and where lattice nodes are joined across a face.
std::vector<Vec3> small_places(const FrameMesh& mesh, const Surface& surface) {
    const double resolution = surface.resolution();
    std::vector<Vec3> result;
    for (const int v : small_handles(mesh.vertices, mesh.carved.triangles,
                                     std::vector<char>(mesh.vertices.size(), 1), kSmall * resolution))
        result.push_back(mesh.vertices[v]);
    for (const auto& diagonal : surface.diagonals()) result.push_back(0.5 * (diagonal.from + diagonal.to));
    return apart(result, kApart * resolution, kMostPlaces);
}

/// Where the next sheet is near; none if that is at more than `kMostPlaces`.
std::vector<Vec3> narrow_places(const FrameMesh& mesh, const std::vector<double>& thickness,
                                double resolution) {
    std::vector<Vec3> result;
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v)
        if (const int p = mesh.carved.particle[v]; p >= 0 && thickness[p] < kNarrow * resolution)
            result.push_back(mesh.vertices[v]);
    result = apart(result, kApart * resolution, kMostPlaces + 1);
    if (result.size() > kMostPlaces) result.clear();
    return result;
}

/// Places all over a mesh that leave nothing of it out. None where there are too many, or where the triangles
/// are so large that what goes of the lattice would be, too.
std::vector<Vec3> places_everywhere(const FrameMesh& mesh, double resolution) {
    std::vector<Vec3> all = apart(mesh.vertices, kCovered * resolution, kMostEverywhere + 1);
    const double area =
        area_of(numbers_below(mesh.carved.triangles.size()), mesh) / (resolution * resolution);
    if (all.size() > kMostEverywhere || area > kMostAreaOfPlace * static_cast<double>(all.size()))
        all.clear();
    return all;
}

/// None where the surface has no lattice.
std::optional<MeshNumbers> numbers_of_lattice(const Surface& surface, Inspector& inspector) {
    const auto euler = surface.lattice_euler();
    if (!euler) return std::nullopt;
    const auto components = inspector.lattice_component_count();
    if (!components) return std::nullopt;
    return MeshNumbers{static_cast<long>(*components), *euler};
}

/// What a search has tried, of all patchers that take part in it.
struct Effort {
    int patches = 0;            // that are made
    double area = 0.0;          // square resolutions, of what goes for them
    int too_far = 0;            // of these: wanted, but farther from the surface than a mesh that is taken
    int refused = 0;            // meshes that are inspected in vain
    std::size_t triangles = 0;  // of the whole meshes that are made
    bool anywhere = false;      // whether all of the mesh was looked at

    bool is_enough(double share = 1.0) const {
        return patches >= share * kMostPatches || area > share * kMostArea || too_far >= kMostTooFar ||
               refused >= kMostRefused || triangles > kMostTriangles;
    }
};

/// Patches of one mesh, which becomes another where one is taken; near some places alone.
class Patcher {
public:
    /// `lattice_reach`: resolutions around the places.
    Patcher(MeshTrials& trials, const std::vector<Vec3>& places, double lattice_reach, const Surface& surface,
            Effort& effort)
        : trials_(trials),
          effort_(effort),
          resolution_(surface.resolution()),
          lattice_(surface.lattice_mesh(places, lattice_reach * resolution_), resolution_) {}

    /// Whether both mesh and lattice, around a place, face much the same way everywhere, as most do: then
    /// nothing is joined or parted there. It takes half the time of the numbers, or less.
    bool is_one_sheet(const Vec3& place, const TriangleTree& mesh) const {
        constexpr double kSameWay = 0.3;  // cosine
        const Vec3 extent = Vec3::Constant(kSmall * resolution_);
        Vec3 mean = Vec3::Zero();  // of the mesh, which has fewer triangles
        for (const TriangleTree* tree : {&mesh, &lattice_.tree()}) {
            std::vector<Vec3> ways;
            for (const int t : tree->meeting(Box(place - extent, place + extent)))
                ways.push_back(area_vector(tree->triangles()[t], tree->points()).normalized());
            if (tree == &mesh) mean = std::accumulate(ways.begin(), ways.end(), mean).normalized();
            if (ways.empty() || std::any_of(ways.begin(), ways.end(),
                                            [&](const Vec3& way) { return !(way.dot(mean) > kSameWay); }))
                return false;
        }
        return true;
    }

    /// Puts those of some places first where mesh and lattice have other numbers around. Returns how many. A
    /// patch seldom changes the numbers at the others, and takes ten times as long to make.
    std::size_t put_differing_first(std::vector<Vec3>& places) {
        const TriangleTree& tree = tree_of_mesh();
        const auto around = [&](const Vec3& place, const TriangleTree& mesh) {
            return triangles_around(place, kSmall * resolution_, mesh);
        };
        std::vector<char> differ(places.size());
        tbb::parallel_for(std::size_t{0}, places.size(), [&](std::size_t p) {
            differ[p] = !is_one_sheet(places[p], tree) &&
                        !have_same_numbers(around(places[p], tree), tree, around(places[p], lattice_.tree()),
                                           lattice_.tree());
        });
        std::vector<Vec3> sorted;
        for (const char first : {1, 0})
            for (std::size_t p = 0; p < places.size(); ++p)
                if (differ[p] == first) sorted.push_back(places[p]);
        places = std::move(sorted);
        return static_cast<std::size_t>(std::count(differ.begin(), differ.end(), 1));
    }

    /// Those of some places where a patch would change the numbers; where none fits, too, if `or_unfit`.
    std::vector<Vec3> unlike(const std::vector<Vec3>& places, bool or_unfit) {
        const TriangleTree& tree = tree_of_mesh();
        std::vector<std::vector<int>> gone(places.size());
        tbb::parallel_for(std::size_t{0}, places.size(), [&](std::size_t p) {
            gone[p] = triangles_around(places[p], kSmall * resolution_, tree);
        });
        std::vector<std::vector<int>> fresh = gone;  // where triangles are large, many places have the same
        std::sort(fresh.begin(), fresh.end());
        fresh.erase(std::unique(fresh.begin(), fresh.end()), fresh.end());
        fresh.erase(std::remove_if(fresh.begin(), fresh.end(),
                                   [&](const std::vector<int>& some) { return change_.count(some) > 0; }),
                    fresh.end());
        std::vector<std::optional<MeshNumbers>> change(fresh.size());
        tbb::parallel_for(std::size_t{0}, fresh.size(),
                          [&](std::size_t n) { change[n] = change_by(patch_for(fresh[n], tree, lattice_)); });
        for (std::size_t n = 0; n < fresh.size(); ++n) change_.emplace(std::move(fresh[n]), change[n]);
        std::vector<char> is_unlike;
        for (const std::vector<int>& some : gone) {
            const auto& by_patch = change_.at(some);
            is_unlike.push_back(by_patch ? !(*by_patch == MeshNumbers{0, 0}) : or_unfit);
        }
        std::vector<Vec3> result = places;
        compact(result, is_unlike);
        return result;
    }

    /// Patches that were tried count as new.
    void try_again() {
        tried_.clear();
        made_.clear();
    }
    /// What is known of the mesh, which is another now.
    void forget() {
        tree_.reset();
        forget_patches();
    }
    /// Takes the patch within `reach` resolutions of a place if it is wanted by how it changes the numbers,
    /// near enough to the surface, wanted by the numbers of the whole mesh, if it crosses nothing, and if its
    /// mesh is taken: `try_mesh`. Returns whether; nullopt where it was wanted by all numbers and failed
    /// then. The places from `place` to `end` are likely to be next with this reach: until `try_again` they
    /// must not change or move.
    template <typename IsWanted, typename AreWanted, typename TryMesh>
    std::optional<bool> patch_at(const Vec3* place, const Vec3* end, double reach, const IsWanted& is_wanted,
                                 const AreWanted& are_wanted, const TryMesh& try_mesh) {
        const FrameMesh& mesh = trials_.mesh();
        const TriangleTree& tree = tree_of_mesh();
        const auto& [gone, patch] = made_at(place, end, reach, is_wanted);
        if (!tried_.insert(gone).second) return false;
        ++effort_.patches;
        effort_.area += area_of(gone, mesh) / (resolution_ * resolution_);
        if (!patch || !is_wanted(*change_by(patch))) return false;
        const std::vector<Vec3> corners = corners_of(*patch, mesh);
        if (!trials_.may_have(corners)) {
            ++effort_.too_far;
            return false;
        }
        if (!stays_manifold(*patch, tree)) return false;
        effort_.triangles += mesh.carved.triangles.size();
        FrameMesh other = patched(mesh, {&*patch});
        if (!are_wanted(numbers_of(other))) return false;
        if (has_flat_triangle(corners) || crosses(*patch, tree)) return std::nullopt;
        if (!try_mesh(std::move(other))) {
            ++effort_.refused;
            return std::nullopt;
        }
        tree_.emplace(
            TriangleTree(mesh.vertices, mesh.carved.triangles, tree, gone));  // reads the one before
        lattice_.look_at(*tree_);
        forget_patches();
        return true;
    }

private:
    void forget_patches() {
        change_.clear();
        try_again();
    }
    struct Made {
        std::vector<int> gone;
        std::optional<Patch> patch;  // if there is one that was not tried and may be wanted
    };
    static std::optional<MeshNumbers> change_by(const std::optional<Patch>& patch) {
        return patch ? std::optional(MeshNumbers{patch->components, patch->euler}) : std::nullopt;
    }
    /// The patch at `place`, made beside those at the next ones if it is not there yet.
    template <typename IsWanted>
    const Made& made_at(const Vec3* place, const Vec3* end, double reach, const IsWanted& is_wanted) {
        constexpr std::ptrdiff_t kAtOnce = 4;
        for (std::size_t p = 0; made_reach_ == reach && p < made_.size(); ++p)
            if (made_from_ + p == place) return made_[p];
        const TriangleTree& tree = tree_of_mesh();
        made_from_ = place;
        made_reach_ = reach;
        made_.assign(static_cast<std::size_t>(std::min(kAtOnce, end - place)), {});
        tbb::parallel_for(std::size_t{0}, made_.size(), [&](std::size_t p) {
            auto& [gone, patch] = made_[p];
            gone = triangles_around(place[p], reach * resolution_, tree);
            const auto known = change_.find(gone);
            const bool is_of_use = known == change_.end() || (known->second && is_wanted(*known->second));
            if (is_of_use && tried_.count(gone) == 0) patch = patch_for(gone, tree, lattice_);
        });
        for (const auto& [gone, patch] : made_)
            change_.emplace(gone, change_by(patch));  // unless it is known
        return made_.front();
    }
    const TriangleTree& tree_of_mesh() {
        const FrameMesh& mesh = trials_.mesh();
        if (!tree_) {
            tree_.emplace(mesh.vertices, mesh.carved.triangles);
            lattice_.look_at(*tree_);
        }
        return *tree_;
    }

    MeshTrials& trials_;
    Effort& effort_;
    const double resolution_;
    PatchSource lattice_;
    std::optional<TriangleTree> tree_;  // of the mesh as it is
    std::set<std::vector<int>> tried_;  // triangles of it that went
    // By triangles of it that go, all that were tried among them: how a patch for them changes the numbers,
    // if there is one.
    std::map<std::vector<int>, std::optional<MeshNumbers>> change_;
    // At the places from made_from_ on.
    std::vector<Made> made_;
    const Vec3* made_from_ = nullptr;
    double made_reach_ = 0.0;
};

std::size_t patch_topology(MeshTrials& trials, const std::vector<double>& thickness, const Surface& surface,
                           Effort& effort) {
    const double resolution = surface.resolution();
    const std::vector<Vec3> faulty = faulty_places(trials.mesh(), trials.topology(), resolution);
    const auto of_lattice = numbers_of_lattice(surface, trials.inspector());
    if (!of_lattice) return 0;
    // Components and handles that are too many or too few.
    const auto astray = [&](const MeshNumbers& numbers) {
        const long components = numbers.components - of_lattice->components,
                   handles = components - (numbers.euler - of_lattice->euler) / 2;
        return std::abs(components) + std::abs(handles);
    };
    MeshNumbers numbers = numbers_of(trials.mesh());
    long now = astray(numbers);
    if (now == 0) return 0;
    const auto& wanted = trials.inspector().lattice_components();
    if (!wanted) return 0;
    std::unique_ptr<Patcher> patcher;
    const auto make_lattice = [&](const std::vector<Vec3>& some, double reach) {
        patcher.reset();  // before there is another
        patcher = std::make_unique<Patcher>(trials, some, reach, surface, effort);
    };
    std::size_t count = 0;
    std::set<std::array<double, 3>> around;  // vertices where a patch would be right, but did not fit
    // Beyond a patch what it joins or parts may hang together: about so many components more or fewer.
    const auto may_be_wanted = [&](const MeshNumbers& change, long most) {
        if (change.euler == 0 && change.components == 0) return false;
        const long fewest = std::min(change.components, 0L) - 1, many = std::max(change.components, 0L) + 1;
        for (long more = fewest; more <= many; ++more)
            if (astray({numbers.components + more, numbers.euler + change.euler}) <= most) return true;
        return false;
    };
    const auto patch_at = [&](const Vec3* place, const Vec3* end, double reach, long most) {
        MeshNumbers then{};
        const auto taken = patcher->patch_at(
            place, end, reach, [&](const MeshNumbers& change) { return may_be_wanted(change, most); },
            [&](const MeshNumbers& of_other) { return astray(then = of_other) <= most; },
            [&](FrameMesh other) { return trials.try_mesh(std::move(other)); });
        if (!taken) {
            for (const Vec3& v : trials.mesh().vertices)
                if ((v - *place).norm() < reach * resolution) around.insert({v.x(), v.y(), v.z()});
        } else if (*taken) {
            ++count;
            numbers = then;
            now = astray(numbers);
        }
    };
    double share = kLikelyShare;  // of the effort
    const auto patch_near = [&](const std::vector<Vec3>& some, long worse, double most_reach = kFar) {
        for (const double reach : kReaches)
            if (reach <= most_reach)
                for (const Vec3 *place = some.data(), *end = place + some.size(); place != end; ++place)
                    if (now > 0 && !effort.is_enough(share)) patch_at(place, end, reach, now + worse);
        patcher->try_again();
    };
    const auto search = [&](std::vector<Vec3> some, bool has_lattice) {
        if (some.empty() || now == 0 || effort.is_enough(share)) return;
        if (some.size() > kMostPlaces) some.resize(kMostPlaces);
        if (!has_lattice) make_lattice(some, kTriedReach);
        around.clear();
        patch_near(some, -1);
        std::vector<Vec3> more;
        for (const auto& [x, y, z] : around) more.emplace_back(x, y, z);
        patch_near(apart(more, kApart * resolution), -1);
        // Two handles too many here may hide that one is missing elsewhere.
        patch_near(some, 0);
        patch_near(some, -1);
    };
    const std::vector<Vec3> unmatched = unmatched_components(trials.mesh(), *wanted, resolution);
    const auto and_unmatched = [&](std::vector<Vec3> some) {
        some.insert(some.end(), unmatched.begin(), unmatched.end());
        return some;
    };
    std::vector<Vec3> places = and_unmatched(faulty);
    bool small_were_tried = false;
    if (!places.empty() && places.size() <= kFewPlaces) {  // often that is enough
        make_lattice(places, kLookReach);
        const auto differing = static_cast<std::ptrdiff_t>(patcher->put_differing_first(places));
        patch_near({places.begin(), places.begin() + differing}, -1, kSmall);
        if (now > 0) patch_near({places.begin() + differing, places.end()}, -1, kSmall);
        if (now == 0 || effort.is_enough()) return count;
        small_were_tried = true;
    }
    // Some may be mended by now.
    std::vector<Vec3> suspicious = suspicious_places(trials.mesh(), faulty, thickness, resolution);
    places = and_unmatched(suspicious);
    bool all_have_lattice = places.size() <= kMostWithLattice;  // for patches
    if (!places.empty()) {
        make_lattice(places, all_have_lattice ? kTriedReach : kLookReach);
        if (!small_were_tried) {
            const auto differing = static_cast<std::ptrdiff_t>(patcher->put_differing_first(suspicious));
            patch_near(and_unmatched({suspicious.begin(), suspicious.begin() + differing}), -1, kSmall);
            if (now == 0 || effort.is_enough()) return count;
        }
        if (!effort.is_enough(share))
            search(and_unmatched(patcher->unlike(suspicious, places.size() <= kMostPlaces)),
                   all_have_lattice);
    }
    if (now > kMostAstray) return count;
    share = 1.0;
    const auto goes_on = [&] { return now > 0 && !effort.is_enough(); };
    if (goes_on() && !std::exchange(effort.anywhere, true)) {
        const auto look_at = [&](std::vector<Vec3> others, bool or_unfit) {
            if (others.empty()) return;
            make_lattice(others, kTriedReach);
            const auto middle =
                others.begin() + static_cast<std::ptrdiff_t>(patcher->put_differing_first(others));
            const std::vector<Vec3> differing(others.begin(), middle), rest(middle, others.end());
            for (const auto* some : {&differing, &rest})
                if (goes_on()) search(patcher->unlike(*some, or_unfit), true);
        };
        // Each of the first two takes a tenth of the time of the last.
        look_at(small_places(trials.mesh(), surface), true);
        if (goes_on()) look_at(narrow_places(trials.mesh(), thickness, resolution), true);
        if (goes_on()) look_at(places_everywhere(trials.mesh(), resolution), false);
        all_have_lattice = false;
    }
    search(places, all_have_lattice);
    return count;
}

}  // namespace

std::size_t patch_topology(MeshTrials& trials, const std::vector<double>& thickness, const Surface& surface) {
    Effort effort;
    return patch_topology(trials, thickness, surface, effort);
}

std::size_t patch_failing(MeshTrials& trials, const std::vector<double>& thickness, const Surface& surface) {
    const double resolution = surface.resolution();
    std::vector<Vec3> places = apart(trials.failing_places(), kApart * resolution), around;
    if (places.empty() || places.size() > kManyFailing) return 0;  // some less would make it no better
    const auto is_near = [&](const Vec3& place, double distance) {
        return std::any_of(places.begin(), places.end(),
                           [&](const Vec3& other) { return (other - place).norm() < distance * resolution; });
    };
    std::vector<Vec3> failing;  // that is looked at
    const auto look = [&] {
        failing.clear();
        for (const Vec3& place : trials.failing_places())
            if (is_near(place, 2.0 * kAround)) failing.push_back(place);
    };
    look();
    const auto fails_near = [&](const Vec3& place, double distance) {
        return std::any_of(failing.begin(), failing.end(),
                           [&](const Vec3& other) { return (other - place).norm() < distance * resolution; });
    };
    const MeshNumbers numbers = numbers_of(trials.mesh());
    Effort effort;
    Patcher patcher(trials, places, kTriedReach, surface, effort);
    std::size_t count = 0;
    const auto patch_at = [&](const Vec3& place, double reach, const auto& is_wanted,
                              const auto& are_wanted) {
        return patcher
            .patch_at(&place, &place + 1, reach, is_wanted, are_wanted,
                      [&](FrameMesh other) { return trials.try_to_mend(std::move(other)); })
            .value_or(false);
    };
    // Whether then another patch elsewhere brings the numbers back: the mesh had two faults that hid each
    // other.
    const auto patch_twice = [&](const Vec3& place, double reach) {
        FrameMesh before = trials.mesh();
        if (!patch_at(
                place, reach, [](const MeshNumbers&) { return true; },
                [](const MeshNumbers&) { return true; }))
            return false;
        patch_topology(trials, thickness, surface, effort);
        const bool good = numbers_of(trials.mesh()) == numbers;
        if (!good) {
            trials.put_back(std::move(before));
            ++effort.refused;
        }
        patcher.forget();
        return good;
    };
    const auto patch_near = [&](const std::vector<Vec3>& some, double distance, const auto& patch) {
        for (const double reach : kReaches)
            for (const Vec3& place : some) {
                if (effort.is_enough() || !fails_near(place, distance) || !patch(place, reach)) continue;
                ++count;
                look();
            }
        patcher.try_again();
    };
    const auto patch_alone = [&](const Vec3& place, double reach) {
        return patch_at(
            place, reach, [](const MeshNumbers& change) { return change.euler == 0; },
            [&](const MeshNumbers& of_other) { return of_other == numbers; });
    };
    patch_near(places, kApart, patch_alone);
    for (const Vec3& v : trials.mesh().vertices)
        if (is_near(v, kAround) && fails_near(v, kAround)) around.push_back(v);
    patch_near(around, kAround, patch_alone);
    if (failing.empty()) return count;
    if (const auto of_lattice = numbers_of_lattice(surface, trials.inspector());
        of_lattice && numbers == *of_lattice)
        patch_near(places, kApart, patch_twice);
    return count;
}

}  // namespace isotrack
