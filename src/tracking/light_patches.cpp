#include "tracking/light_patches.h"

#include <algorithm>
#include <utility>

#include "meshing/lightening.h"
#include "tracking/failing.h"

namespace isotrack {

std::size_t lighten_patches(MeshTrials& trials, const Surface& surface, const SizingLimits& limits) {
    std::vector<char> put_in;
    for (const int p : trials.mesh().carved.particle) put_in.push_back(p < 0);
    if (std::find(put_in.begin(), put_in.end(), 1) == put_in.end()) return 0;
    FrameMesh mesh = trials.mesh();
    CarvedSurface& carved = mesh.carved;
    const Lightened lightened =
        lighten(mesh.vertices, carved.triangles, put_in, surface, trials.inspector().reached(),
                kChangedShare * limits.tolerance, limits.detail);
    for (std::size_t t = 0; t < carved.triangles.size(); ++t)
        if (lightened.changed[t]) carved.inside_cell[t] = CarvedSurface::kNoCell;
    mesh = without(mesh, lightened.gone);
    const std::size_t went = put_in.size() - mesh.vertices.size();
    return went > 0 && trials.try_mesh(std::move(mesh)) ? went : 0;
}

}  // namespace isotrack
