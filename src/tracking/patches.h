// Parts of a frame's mesh exchanged for those of the lattice of its surface.
#pragma once

#include <vector>

#include "tracking/mesh_trials.h"

namespace isotrack {

/// For a surface that knows its `lattice_euler` and the components of its lattice. While the mesh has other
/// numbers of components or handles parts of it are exchanged for those of the lattice mesh, small ones
/// first, where that brings the numbers nearer and crosses nothing: around places where mesh and lattice
/// disagree, up to 3.5 resolutions if those are 30 at most; then also, unless there are hundreds, where
/// sheets are thin, up to 8 resolutions, in the end even where that leaves the numbers as far off. Where that
/// does not do and the numbers are off by 30 at most, small handles anywhere and the faces across which nodes
/// are joined are looked at, then where the next sheet is within three resolutions, unless that is at
/// hundreds of places, then all of the mesh, once: for one of up to 20 000 places two resolutions apart with
/// no more than 50 square resolutions for each. All that is given up after 1000 patches, or as many as cover
/// 50 000 square resolutions, when 50 were too far from the surface, 50 meshes were refused, or those looked
/// at had ten million triangles: what is left then stays wrong. `thickness`: per particle, the distance to
/// the next sheet. New vertices stand on no particle, new triangles are no facets. Returns how many parts
/// were exchanged.
std::size_t patch_topology(MeshTrials& trials, const std::vector<double>& thickness, const Surface& surface);

/// The same around places that particles did not mend, where too far a triangle or a missed point is left,
/// while these become fewer and the numbers of components and handles stay, if need be, where they are
/// the lattice's, by one more patch elsewhere. Nothing where they are more than `kManyFailing`.
std::size_t patch_failing(MeshTrials& trials, const std::vector<double>& thickness, const Surface& surface);

}  // namespace isotrack
