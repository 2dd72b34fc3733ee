#include "tracking/light_patches.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "isotrack/sampling/particle_grid.h"
#include "meshing/lightening.h"
#include "parallel_for_each.h"
#include "tracking/failing.h"

namespace isotrack {
namespace {

constexpr int kTries = 2;
constexpr std::size_t kGrain = 256;
constexpr double kAround = 4.0;  // details: what was in vain within so much stays as it was

bool any_of(const std::vector<char>& flags) {
    return std::find(flags.begin(), flags.end(), 1) != flags.end();
}

}  // namespace

std::size_t lighten_patches(MeshTrials& trials, const Surface& surface, const SizingLimits& limits) {
    std::vector<char> may_go;
    for (const int p : trials.mesh().carved.particle) may_go.push_back(p < 0);
    for (int attempt = 0; attempt < kTries && any_of(may_go); ++attempt) {
        FrameMesh mesh = trials.mesh();
        CarvedSurface& carved = mesh.carved;
        const Lightened lightened =
            lighten(mesh.vertices, carved.triangles, may_go, surface, trials.inspector().reached(),
                    kChangedShare * limits.tolerance, limits.detail);
        for (std::size_t t = 0; t < carved.triangles.size(); ++t)
            if (lightened.changed[t]) carved.facet[t] = CarvedSurface::kNoFacet;
        mesh = without(std::move(mesh), lightened.gone);
        const std::size_t went = may_go.size() - mesh.vertices.size();
        if (went == 0) return 0;
        if (trials.try_mesh(std::move(mesh))) return went;
        if (attempt + 1 == kTries) break;
        MeshTrials::Outlook outlook = trials.look_at(mesh);
        std::vector<Vec3>& in_vain = outlook.newly_missed;
        in_vain.insert(in_vain.end(), outlook.failing.begin(), outlook.failing.end());
        const double around = kAround * limits.detail;
        PointGrid grid(in_vain, around, in_vain.size());
        grid.take_new();
        parallel_for_each(may_go.size(), kGrain, [&](std::size_t v) {
            if (may_go[v])
                grid.for_each_within(trials.mesh().vertices[v], around, [&](int, double) { may_go[v] = 0; });
        });
    }
    return 0;
}

}  // namespace isotrack
