#include <openvdb/tools/Composite.h>
#include <openvdb/tools/ParticlesToLevelSet.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "io/sample_source.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"

namespace isotrack {
namespace {

constexpr int kDrops = 3000;
constexpr double kPoolDepth = 0.1487;  // not on nodes of lattices of round numbers, where drops would touch it
constexpr double kSmallest = 0.012, kLargest = 0.045;      // radii; most drops are small
constexpr double kFirstLaunch = 0.02, kLastLaunch = 0.55;  // all is calm again before the end, at 1
constexpr double kShortestFlight = 0.15, kLongestFlight = 0.42;
constexpr double kGravity = 22.0;  // the longest flight rises to 0.5

/// A drop on its parabola. It starts and ends just below the pool's surface, out of sight.
struct Drop {
    Vec3 start, velocity;
    double radius, launch, flight;

    bool is_aloft(double time) const { return time > launch && time < launch + flight; }
    Vec3 position(double time) const {
        const double t = time - launch;
        return start + t * velocity - Vec3(0.0, 0.0, 0.5 * kGravity * t * t);
    }
    Vec3 velocity_at(double time) const { return velocity - Vec3(0.0, 0.0, kGravity * (time - launch)); }
};

std::vector<Drop> throw_drops(std::uint64_t seed) {
    std::mt19937_64 random(seed);
    // Spelled out, since the standard's distributions differ between libraries.
    const auto uniform = [&random](double low, double high) {
        return low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
    };
    std::vector<Drop> drops(kDrops);
    for (Drop& drop : drops) {
        const double size = uniform(0.0, 1.0);
        drop.radius = kSmallest + (kLargest - kSmallest) * std::pow(size, 5);
        drop.launch = uniform(kFirstLaunch, kLastLaunch);
        drop.flight = uniform(kShortestFlight, kLongestFlight);
        const double x = uniform(0.1, 0.9), y = uniform(0.1, 0.9);
        const double land_x = std::clamp(x + uniform(-0.15, 0.15), 0.05, 0.95);
        const double land_y = std::clamp(y + uniform(-0.15, 0.15), 0.05, 0.95);
        drop.start = {x, y, kPoolDepth - drop.radius};
        drop.velocity = {(land_x - x) / drop.flight, (land_y - y) / drop.flight,
                         0.5 * kGravity * drop.flight};
    }
    return drops;
}

/// The drops of one moment, as ParticlesToLevelSet wants them: with their velocity as the attribute it hands
/// on.
class DropList {
public:
    using PosType = openvdb::Vec3R;

    DropList(const std::vector<Drop>& drops, double time) : time_(time) {
        for (const Drop& drop : drops)
            if (drop.is_aloft(time)) aloft_.push_back(&drop);
    }
    std::size_t size() const { return aloft_.size(); }
    void getPos(std::size_t n, openvdb::Vec3R& position) const {
        position = openvdb::Vec3R(aloft_[n]->position(time_).data());
    }
    void getPosRad(std::size_t n, openvdb::Vec3R& position, openvdb::Real& radius) const {
        getPos(n, position);
        radius = aloft_[n]->radius;
    }
    void getAtt(std::size_t n, openvdb::Vec3f& velocity) const {
        velocity = openvdb::Vec3f(openvdb::Vec3R(aloft_[n]->velocity_at(time_).data()));
    }

private:
    double time_;
    std::vector<const Drop*> aloft_;
};

class SplashSource final : public SampleSource {
public:
    SplashSource(int frames, double voxel, std::uint64_t seed)
        : step_(frame_step(frames)), drops_(throw_drops(seed)) {
        const Vec3 half(0.5, 0.5, 0.5 * kPoolDepth);
        pool_ = rasterise(*shapes::box(half, half, voxel), voxel);
    }

    SampleFrame next() override {
        const DropList aloft(drops_, step_ * frame_++);
        auto drops = openvdb::createLevelSet<openvdb::FloatGrid>(pool_->voxelSize().x());
        openvdb::tools::ParticlesToLevelSet<openvdb::FloatGrid, openvdb::Vec3f> raster(*drops);
        raster.setGrainSize(0);  // one thread: of drops that overlap, it is always the same that owns a voxel
        raster.rasterizeSpheres(aloft);
        raster.finalize();
        const openvdb::Vec3SGrid::ConstPtr drop_velocity = raster.attributeGrid();

        SampleFrame frame;
        frame.surface = pool_->deepCopy();
        openvdb::tools::csgUnion(*frame.surface, *drops->deepCopy());
        const auto velocity = [&](const Vec3& p) {
            const openvdb::Coord ijk = pool_->transform().worldToIndexCellCentered(openvdb::Vec3d(p.data()));
            if (!(drops->tree().getValue(ijk) < pool_->tree().getValue(ijk))) return Vec3(Vec3::Zero());
            const openvdb::Vec3f v = drop_velocity->tree().getValue(ijk);
            return Vec3(v.x(), v.y(), v.z());
        };
        frame.velocity = sample_velocity(*frame.surface, velocity, step_);
        return frame;
    }

private:
    double step_;
    int frame_ = 0;
    std::vector<Drop> drops_;
    openvdb::FloatGrid::Ptr pool_;
};

}  // namespace

std::unique_ptr<SampleSource> make_splash(int frames, double voxel, std::uint64_t seed) {
    return std::make_unique<SplashSource>(frames, voxel, seed);
}

}  // namespace isotrack
