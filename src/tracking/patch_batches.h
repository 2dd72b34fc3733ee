// Many parts of a frame's mesh exchanged for those of the lattice at once.
#pragma once

#include <cstddef>

#include "tracking/mesh_trials.h"

namespace isotrack {

/// Places apart from each other where a mesh fails: more are mended in batches, no more one after the other.
constexpr std::size_t kManyFailing = 64;
bool fails_at_many(const MeshTrials& trials, const Surface& surface);

/// Where a mesh fails at one place for ten triangles or more, as one of a density that is all noise does:
/// takes the lattice's for it, `light_lattice_mesh`, if it misses less of the surface. No vertex stands on a
/// particle then. Returns whether it did.
bool take_lattice_mesh(MeshTrials& trials, const Surface& surface, const SizingLimits& limits);

/// Where a mesh fails at many places, as on a splash with drops and sheets of a voxel, of which particles
/// make crumbs: parts around the places are exchanged for those of the lattice of the surface, small ones
/// first. Patches that have nothing in common are put in together; those that cross something, that leave as
/// much failing around them as was there, or that miss what was not missed are left out again. New vertices
/// stand on no particle, new triangles are no facets. Returns how many parts were exchanged.
std::size_t mend_in_batches(MeshTrials& trials, const Surface& surface);

}  // namespace isotrack
