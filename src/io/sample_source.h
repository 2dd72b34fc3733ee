// What stands behind a SampleSequence: one source of frames per kind of shape.
#pragma once

#include <openvdb/openvdb.h>

#include <cstdint>
#include <functional>
#include <memory>

#include "isotrack/io/sample_sequence.h"
#include "isotrack/types.h"

namespace isotrack {

/// The frames of one shape, in order.
class SampleSource {
public:
    virtual ~SampleSource() = default;
    virtual SampleFrame next() = 0;
};

/// How much of the whole motion, which lasts 1, happens from one frame to the next.
inline double frame_step(int frames) {
    return frames > 1 ? 1.0 / (frames - 1) : 1.0;
}

/// `velocity` times `factor` at the active voxels of `surface`. The function is called from several threads.
openvdb::Vec3SGrid::Ptr sample_velocity(const openvdb::FloatGrid& surface,
                                        const std::function<Vec3(const Vec3&)>& velocity, double factor);

/// A sphere of radius 0.15 around (0.35, 0.35, 0.35) in the deformation field of LeVeque 1996
/// ("High-resolution conservative algorithms for advection in incompressible flow"), which Enright et al.
/// 2002 ("A hybrid particle level set method") made a test: period 3, followed here from time 0 to 0.8, into
/// a thin sheet.
std::unique_ptr<SampleSource> make_enright(int frames, double voxel);

/// A pool that throws up drops, which fall back into it.
std::unique_ptr<SampleSource> make_splash(int frames, double voxel, std::uint64_t seed);

}  // namespace isotrack
