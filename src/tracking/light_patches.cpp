#include "tracking/light_patches.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "meshing/lightening.h"
#include "tracking/failing.h"

namespace isotrack {
namespace {

constexpr int kTries = 2;
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
            if (lightened.changed[t]) carved.inside_cell[t] = CarvedSurface::kNoCell;
        mesh = without(std::move(mesh), lightened.gone);
        const std::size_t went = may_go.size() - mesh.vertices.size();
        if (went == 0) return 0;
        if (trials.try_mesh(std::move(mesh))) return went;
        if (attempt + 1 == kTries) break;
        const MeshTrials::Outlook outlook = trials.look_at(mesh);
        for (const auto* places : {&outlook.newly_missed, &outlook.failing})
            for (const Vec3& place : *places)
                for (std::size_t v = 0; v < may_go.size(); ++v)
                    if ((trials.mesh().vertices[v] - place).norm() < kAround * limits.detail) may_go[v] = 0;
    }
    return 0;
}

}  // namespace isotrack
