#include <openvdb/tools/LevelSetAdvect.h>

#include "io/sample_source.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"

namespace isotrack {
namespace {

constexpr double kEndTime = 0.8;

class EnrightSource final : public SampleSource {
public:
    EnrightSource(int frames, double voxel)
        : step_(kEndTime * frame_step(frames)),
          grid_(rasterise(*shapes::sphere(Vec3::Constant(0.35), 0.15, voxel), voxel)),
          advection_(*grid_, Field()) {
        // The schemes of OpenVDB's own Enright test.
        advection_.setSpatialScheme(openvdb::math::HJWENO5_BIAS);
        advection_.setTemporalScheme(openvdb::math::TVD_RK2);
        advection_.setTrackerSpatialScheme(openvdb::math::HJWENO5_BIAS);
        advection_.setTrackerTemporalScheme(openvdb::math::TVD_RK1);
    }

    SampleFrame next() override {
        const double time = step_ * frame_++;
        if (time > 0.0) advection_.advect(static_cast<float>(time - step_), static_cast<float>(time));
        SampleFrame frame;
        frame.surface = grid_->deepCopy();
        const auto velocity = [time](const Vec3& p) {
            const openvdb::Vec3f v = Field()(openvdb::Vec3d(p.data()), static_cast<float>(time));
            return Vec3(v.x(), v.y(), v.z());
        };
        frame.velocity = sample_velocity(*frame.surface, velocity, step_);
        return frame;
    }

private:
    using Field = openvdb::tools::EnrightField<float>;

    double step_;
    int frame_ = 0;
    openvdb::FloatGrid::Ptr grid_;
    openvdb::tools::LevelSetAdvection<openvdb::FloatGrid, Field> advection_;
};

}  // namespace

std::unique_ptr<SampleSource> make_enright(int frames, double voxel) {
    return std::make_unique<EnrightSource>(frames, voxel);
}

}  // namespace isotrack
