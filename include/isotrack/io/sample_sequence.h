// Sample sequences of level sets, made by formula: for first steps, tests and benchmarks. All shapes live in the unit cube.
#pragma once

#include <openvdb/openvdb.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace isotrack {

struct SampleSequenceOptions {
    int frames = 24;                 ///< > 0. The same motion in more frames: from one to the next there is less of it.
    std::optional<double> voxel;     ///< World units, 0.0001 to 0.1. Unset: the shape's own default.
    std::uint64_t seed = 1;          ///< For the splash.
};

struct SampleShape {
    std::string name;         ///< As on the command line: "sphere", "enright", ...
    std::string description;  ///< One line.
    double default_voxel;
};

/// All shapes, in the order of the help text.
const std::vector<SampleShape>& sample_shapes();

struct SampleFrame {
    openvdb::FloatGrid::Ptr surface;         ///< Class level set, called "surface", half width 3 voxels; empty where there is nothing.
    openvdb::Vec3SGrid::Ptr velocity;        ///< Called "velocity", in the band, world units per frame at this frame; null where it is not known.
};

/// Makes frames one after the other, in order, because some shapes are advected. Uses TBB inside; the same values at any thread count.
/// Voxels hold exact distances, but for enright (advected), and for splash inside the water (lower bounds). The splash leaves out
/// drops with a radius under 1.5 voxels: from 0.03 on there are none.
class SampleSequence {
public:
    /// \throws OptionError for an unknown shape (the message lists them) or an option outside its range.
    SampleSequence(const std::string& shape, const SampleSequenceOptions& options = {});
    ~SampleSequence();
    int size() const;
    SampleFrame next();  ///< \throws std::out_of_range after the last.

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace isotrack
