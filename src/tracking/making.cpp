#include "tracking/making.h"

#include <algorithm>
#include <utility>

#include "tracking/failing.h"
#include "tracking/light_patches.h"
#include "tracking/lost_drops.h"
#include "tracking/mesh_trials.h"
#include "tracking/patch_batches.h"
#include "tracking/patches.h"
#include "tracking/refinement.h"
#include "tracking/relabelling.h"
#include "tracking/specks.h"
#include "tracking/stage_timer.h"

namespace isotrack {
namespace {

constexpr int kMostMendings = 1;
constexpr double kFew = 0.03;  // of the particles: few enough to be added by certify, without relaxation
constexpr double kFewFollowing = 0.06;  // likewise where frames before were relaxed, and nothing is fitted
constexpr int kCertifyRounds = 24;
constexpr int kMostTrials = 2;        // rounds of other labels: each takes some meshes
constexpr int kMostRelabellings = 4;  // what changes sides might go on changing them

}  // namespace

void Tracker::Impl::Making::make_mesh() {
    auto& seconds = work_.frame.seconds;
    work_.mesh = {};
    work_.mesh = tracker_.carve_mesh(work_.surface, seconds);
    if (!options().fit) return;
    const StageTimer timer(seconds, "fit");
    fitted_.fit_vertices(work_.mesh, particles().size(), work_.surface, tracker_.flips_within(work_.limits));
}

void Tracker::Impl::Making::mesh_particles() {
    Inspector& inspector = *work_.inspector;
    LastMesh& last_mesh = tracker_.last_mesh;
    const double few = work_.follows && !options().fit ? kFewFollowing : kFew;
    for (int mending = 0;; ++mending) {
        std::function<void()> measure_expected;
        if (!options().fit && !in_paper())
            measure_expected = inspector.expect(particles().position, last_mesh.triangles);
        tracker_.tetrahedralise(
            true, work_.frame.seconds,
            [&] {
                if (measure_expected) measure_expected();
                tracker_.prepare_topology(work_);
            },
            measure_expected ? 1 : 0);
        // The last mesh is of no more use, and the most memory is needed from now on.
        last_mesh.take({});
        make_mesh();
        const StageTimer timer(work_.frame.seconds, "certify");
        if (in_paper()) break;
        work_.inspection =
            mending == 0 ? inspector.inspect(work_.mesh) : inspector.inspect_both_ways(work_.mesh);
        densifier_.emplace(tracker_.make_densifier(work_.surface, work_.limits, work_.crossings->size()));
        added_ = mend();
        if (mending == kMostMendings ||
            static_cast<double>(added_) < few * static_cast<double>(particles().size()))
            break;
        // What is known of this mesh has no use any more.
        work_.inspection = {};
        inspector.restart();
        densifier_.reset();
        fitted_ = {};
        work_.mesh = {};
        tracker_.make_room(work_.surface, work_.frame);
    }
}

void Tracker::Impl::Making::insert_added() {
    // A fitted mesh fails elsewhere than its particles do; of a DT built anew all cells are new.
    const bool refines = !options().fit && guided() && options().delaunay != UpdateStrategy::Rebuild;
    auto& seconds = work_.frame.seconds;
    tracker_.tetrahedralise(false, seconds);
    if (refines) {
        const StageTimer timer(seconds, "certify");
        refine(*tracker_.dt, tracker_.labels, particles(), *densifier_, work_.surface, work_.limits);
        tracker_.in_dt = particles().id;
    }
    make_mesh();
}

bool Tracker::Impl::Making::passes() {
    if (mend() > 0) return false;
    if (options().reconstruction != Reconstruction::Guided || relabellings_ == kMostRelabellings) return true;
    ++relabellings_;
    CellLabels& labels = tracker_.labels;
    return reach_out(labels, cells(), work_.mesh, work_.inspection, particles(), work_.surface,
                     work_.limits) == 0 &&
           relabel(labels, cells(), work_.mesh, work_.inspection, particles(), work_.surface, work_.limits) ==
               0;
}

void Tracker::Impl::Making::mend_components() {
    FrameMesh& mesh = work_.mesh;
    Inspection& inspection = work_.inspection;
    if (guided()) {
        const Carve carve_labels = [&](CellLabels& of_cells) {
            FrameMesh other = tracker_.mesh_of(of_cells, work_.surface);
            if (!options().fit) return other;
            Fitted its_own = fitted_;
            its_own.fit_vertices(other, particles().size(), work_.surface,
                                 tracker_.flips_within(work_.limits));
            its_own.undo_crossing(other, particles().position);
            return other;
        };
        MeshTrials trials(mesh, inspection, *work_.inspector, work_.limits);
        if (join_specks(trials, tracker_.labels, carve_labels, cells(), particles(), work_.surface,
                        work_.limits) > 0)
            tracker_.last_mesh.take(mesh.carved, particles(), cells());
    }
    const std::vector<std::vector<Vec3>> lost = inspection.topology.lost;
    remove_specks(mesh, inspection, *work_.inspector, work_.limits);
    if (guided() && !options().min_edge)
        put_in_drops(lost, mesh, inspection, *work_.inspector, work_.surface);
}

void Tracker::Impl::Making::certify() {
    FrameMesh& mesh = work_.mesh;
    Inspection& inspection = work_.inspection;
    Inspector& inspector = *work_.inspector;
    int trials = 0;
    for (int round = 0;; ++round) {
        if (round > 0 || added_ > 0) insert_added();
        const StageTimer timer(work_.frame.seconds, "certify");
        const bool last = in_paper() || round == kCertifyRounds;
        const auto passes_or_last = [&] { return last || passes(); };
        inspect_both_ways();
        if (!passes_or_last()) continue;
        if (options().fit && fitted_.undo_crossing(mesh, particles().position)) {
            inspect_both_ways();
            if (!passes_or_last()) continue;
        }
        inspector.look_between(mesh, inspection);
        tracker_.last_mesh.take(mesh.carved, particles(), cells());
        const bool known = has_topology();
        if (!known) inspector.inspect_topology(mesh, inspection);
        if (!passes_or_last()) continue;
        if (known) return;
        mend_components();
        if (last || ++trials == kMostTrials || inspection.missed.empty() || mend() == 0) return;
    }
}

void Tracker::Impl::Making::patch() {
    fitted_ = {};  // of no more use
    densifier_.reset();
    if (!tracker_.patches()) return;
    const StageTimer timer(work_.frame.seconds, "certify");
    const std::vector<double>& thickness = tracker_.last_mesh.evidence.thickness;
    MeshTrials of_mesh(work_.mesh, work_.inspection, *work_.inspector, work_.limits);
    const bool fails_much = fails_at_many(of_mesh, work_.surface);
    if (fails_much) {
        std::vector<double> errors =
            errors_at_particles(work_.mesh, *work_.inspection.errors, particles().size());
        if (take_lattice_mesh(of_mesh, work_.surface, work_.limits)) {
            is_of_particles_ = false;
            tracker_.last_mesh.evidence.error = std::move(errors);
            work_.inspector->look_off_surface(work_.mesh, work_.inspection);
            return;
        }
    }
    if (fails_much) mend_in_batches(of_mesh, work_.surface);
    if (!has_topology()) {
        if (work_.inspection.topology.speck.size() != work_.mesh.carved.triangles.size())
            work_.inspector->inspect_topology(work_.mesh, work_.inspection);
        patch_topology(of_mesh, thickness, work_.surface);
    }
    work_.inspector->look_off_surface(work_.mesh, work_.inspection);
    if (!fails_much) patch_failing(of_mesh, thickness, work_.surface);
    lighten_patches(of_mesh, work_.surface, work_.limits);
}

}  // namespace isotrack
