#include "tracking/patch_batches.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "isotrack/meshing/mesh_topology.h"
#include "meshing/crossing_triangles.h"
#include "meshing/patch.h"
#include "parallel_for_each.h"
#include "sampling/compact.h"
#include "tracking/failing.h"
#include "tracking/patching.h"

namespace isotrack {
namespace {

// All in resolutions.
constexpr double kApart = 1.5;  // places that near are one
constexpr double kReaches[] = {1.5, 2.0, 2.7, 3.5, 4.7};
constexpr double kLatticeReach = 16.0;  // around the places
constexpr double kMargin = 1.0;         // around a patch, of what is counted for it

/// A patch on trial.
struct Candidate {
    Patch patch;
    Box box;  // of the place, what goes and what comes, and some more
    bool is_out = false;
};

Box with_margin(const Box& box, double margin) {
    return {box.min() - Vec3::Constant(margin), box.max() + Vec3::Constant(margin)};
}

std::size_t count_within(const Box& box, const std::vector<Vec3>& places) {
    return static_cast<std::size_t>(
        std::count_if(places.begin(), places.end(), [&](const Vec3& p) { return box.contains(p); }));
}

/// Patches of one mesh that have no vertex in common.
class Batch {
public:
    /// `tree`: of the mesh as it is, which `lattice` looks at.
    Batch(MeshTrials& trials, const TriangleTree& tree, PatchSource& lattice, const Surface& surface)
        : trials_(trials), tree_(tree), lattice_(lattice), margin_(kMargin * surface.resolution()) {}

    /// Around some of these places.
    void make(const std::vector<Vec3>& places, double reach) {
        std::vector<std::vector<int>> gone(places.size());
        parallel_for_each(places.size(), 1,
                          [&](std::size_t p) { gone[p] = triangles_around(places[p], reach, tree_); });
        std::vector<char> taken(trials_.mesh().vertices.size(), 0);
        std::vector<std::vector<int>> apart;
        std::vector<Vec3> middles;  // of these
        for (std::size_t p = 0; p < places.size(); ++p) {
            std::vector<int>& some = gone[p];
            const auto is_taken = [&](int t) {
                const Triangle& corners = tree_.triangles()[t];
                return std::any_of(corners.begin(), corners.end(), [&](int v) { return taken[v] != 0; });
            };
            if (some.empty() || std::any_of(some.begin(), some.end(), is_taken)) continue;
            for (const int t : some)
                for (const int v : tree_.triangles()[t]) taken[v] = 1;
            apart.push_back(std::move(some));
            middles.push_back(places[p]);
        }
        std::vector<std::optional<Patch>> patches(apart.size());
        parallel_for_each(apart.size(), 1, [&](std::size_t p) {
            patches[p] = patch_for(apart[p], tree_, lattice_);
            if (!patches[p]) return;
            const std::vector<Vec3> corners = corners_of(*patches[p], trials_.mesh());
            if (has_flat_triangle(corners) || !trials_.may_have(corners) ||
                !stays_manifold(*patches[p], tree_))
                patches[p].reset();
        });
        for (std::size_t p = 0; p < patches.size(); ++p) {
            auto& patch = patches[p];
            if (!patch) continue;
            Box box(middles[p]);
            for (const int t : patch->gone) box.extend(tree_.box_of(t));
            for (const Vec3& corner : corners_of(*patch, trials_.mesh())) box.extend(corner);
            candidates_.push_back({std::move(*patch), with_margin(box, margin_)});
        }
    }

    /// Puts in as many of them as do good. Returns how many.
    std::size_t put_in() {
        const std::vector<Vec3> failing = trials_.failing_places();
        for (;;) {  // with fewer each time
            FrameMesh other = leave_out_crossing();
            if (candidates_.empty()) break;
            const MeshTrials::Outlook outlook = trials_.look_at(other);
            for (Candidate& c : candidates_)
                c.is_out = count_within(c.box, outlook.newly_missed) > 0 ||
                           count_within(c.box, outlook.failing) >= count_within(c.box, failing);
            if (leave_out()) continue;
            if (!trials_.try_mesh(std::move(other))) break;
            return candidates_.size();
        }
        return 0;
    }

private:
    /// Whether there were any.
    bool leave_out() {
        const auto out = std::remove_if(candidates_.begin(), candidates_.end(),
                                        [](const Candidate& c) { return c.is_out; });
        const bool any = out != candidates_.end();
        candidates_.erase(out, candidates_.end());
        return any;
    }
    /// The mesh with those that cross nothing.
    FrameMesh leave_out_crossing() {
        for (;;) {
            std::vector<const Patch*> patches;
            std::size_t coming = 0;
            for (const Candidate& c : candidates_) {
                patches.push_back(&c.patch);
                coming += c.patch.triangles.size();
            }
            FrameMesh result = patched(trials_.mesh(), patches);
            const std::size_t count = result.carved.triangles.size();
            std::vector<char> fresh(count, 0);
            std::fill(fresh.end() - static_cast<std::ptrdiff_t>(coming), fresh.end(), 1);
            const std::vector<char> crossing =
                crossing_triangles(result.vertices, result.carved.triangles, fresh);
            auto at = crossing.end() - static_cast<std::ptrdiff_t>(coming);
            for (Candidate& c : candidates_) {
                const auto end = at + static_cast<std::ptrdiff_t>(c.patch.triangles.size());
                c.is_out = std::find(at, end, 1) != end;
                at = end;
            }
            if (!leave_out()) return result;
        }
    }
    MeshTrials& trials_;
    const TriangleTree& tree_;
    PatchSource& lattice_;
    const double margin_;
    std::vector<Candidate> candidates_;
};

}  // namespace

bool fails_at_many(const MeshTrials& trials, const Surface& surface) {
    return apart(trials.failing_places(), kApart * surface.resolution()).size() > kManyFailing;
}

bool take_lattice_mesh(MeshTrials& trials, const Surface& surface, const SizingLimits& limits) {
    constexpr double kLeastFailing = 0.05;  // places for each triangle
    const auto triangles = static_cast<double>(trials.mesh().carved.triangles.size());
    if (trials.inspection().missed.empty() ||
        static_cast<double>(trials.failing_places().size()) < kLeastFailing * triangles)
        return false;
    const TriangleMesh lattice = surface.light_lattice_mesh(kCertified * limits.tolerance);
    const MeshTopology topology = mesh_topology(lattice);
    if (lattice.triangles.empty() || !topology.closed() || !topology.manifold()) return false;
    FrameMesh mesh;
    append(mesh, lattice.points, lattice.triangles);
    return trials.take_if_misses_less(std::move(mesh));
}

std::size_t mend_in_batches(MeshTrials& trials, const Surface& surface) {
    const double resolution = surface.resolution();
    const auto places_now = [&] { return apart(trials.failing_places(), kApart * resolution); };
    std::vector<Vec3> places = places_now();
    PatchSource lattice(surface.lattice_mesh(places, kLatticeReach * resolution), resolution);
    std::optional<TriangleTree> tree;  // of the mesh as it is
    std::size_t count = 0;
    for (const double reach : kReaches) {
        if (places.empty()) break;
        if (!tree) {
            tree.emplace(trials.mesh().vertices, trials.mesh().carved.triangles);
            lattice.look_at(*tree);
        }
        Batch batch(trials, *tree, lattice, surface);
        batch.make(places, reach * resolution);
        const std::size_t put_in = batch.put_in();
        if (put_in == 0) continue;
        count += put_in;
        tree.reset();
        places = places_now();
    }
    return count;
}

}  // namespace isotrack
