#include "isotrack/io/sample_sequence.h"

#include <openvdb/tree/LeafManager.h>

#include <cmath>
#include <stdexcept>
#include <string>

#include "io/sample_source.h"
#include "isotrack/error.h"
#include "isotrack/surface/rasterise.h"
#include "isotrack/surface/shapes.h"

namespace isotrack {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kSmallestVoxel = 1e-4, kLargestVoxel = 0.1;
const Vec3 kMiddle = Vec3::Constant(0.5);  // all shapes live in the unit cube

/// A shape at one time of its motion, which lasts from 0 to 1.
struct Moment {
    shapes::SurfacePtr solid;
    std::function<Vec3(const Vec3&)> velocity;  // world units per whole motion; none: not known
};

/// A rotation that turns at `angle_rate` and a centre that moves at `drift`.
struct RigidMotion {
    Vec3 centre, axis;
    double angle;
    Vec3 drift;
    double angle_rate;

    Eigen::Isometry3d place() const { return Eigen::Translation3d(centre) * Eigen::AngleAxisd(angle, axis); }
    Vec3 velocity(const Vec3& p) const { return drift + angle_rate * axis.cross(p - centre); }
};

Moment rigid(const shapes::SurfacePtr& solid, const RigidMotion& motion) {
    return {shapes::moved(solid, motion.place()), [motion](const Vec3& p) { return motion.velocity(p); }};
}

Moment sphere(double time, double voxel) {
    const double pulse = 4.0 * kPi * time, radius = 0.2 + 0.04 * std::sin(pulse);
    const double growth = 0.04 * 4.0 * kPi * std::cos(pulse);
    const Vec3 drift(0.3, 0.0, 0.0), centre = kMiddle + (time - 0.5) * drift;
    return {shapes::sphere(centre, radius, voxel),
            [=](const Vec3& p) { return Vec3(drift + growth * (p - centre).normalized()); }};
}

/// Stretched along its longest axis and thinned across it, the volume kept, while it turns.
Moment ellipsoid(double time, double voxel) {
    const double stretch = std::exp(0.4 * std::sin(2.0 * kPi * time));
    const double rate = 0.4 * 2.0 * kPi * std::cos(2.0 * kPi * time);  // of the stretch, relative
    const Vec3 thinned = Vec3(0.0, 0.16, 0.12) / std::sqrt(stretch);
    const RigidMotion turn{kMiddle, Vec3(0, 1, 1).normalized(), 0.5 * kPi * time, Vec3::Zero(), 0.5 * kPi};
    Moment moment =
        rigid(shapes::ellipsoid(Vec3::Zero(), {0.22 * stretch, thinned.y(), thinned.z()}, voxel), turn);
    moment.velocity = [=](const Vec3& p) {
        const Mat3 rotation = turn.place().linear();
        const Vec3 body = rotation.transpose() * (p - turn.centre);
        return Vec3(turn.velocity(p) + rotation * (rate * body.cwiseProduct(Vec3(1.0, -0.5, -0.5))));
    };
    return moment;
}

Moment torus(double time, double voxel) {
    return rigid(shapes::torus(Vec3::Zero(), 0.25, 0.08, voxel),
                 {kMiddle, Vec3::UnitX(), kPi * time, Vec3::Zero(), kPi});
}

Moment plate(double time, double voxel) {
    const Vec3 drift(0.0, 0.0, 0.4);
    const double swing = 2.0 * kPi * time;
    return rigid(
        shapes::plate(Vec3::Zero(), 0.35, 0.06, voxel),
        {kMiddle + (time - 0.5) * drift, Vec3::UnitX(), 0.5 * std::sin(swing), drift, kPi * std::cos(swing)});
}

Moment shell(double time, double voxel) {
    const double growth = 0.15;
    return {shapes::shell(kMiddle, 0.25 + growth * time, 0.06, voxel),
            [growth](const Vec3& p) { return Vec3(growth * (p - kMiddle).normalized()); }};
}

Moment box(double time, double voxel) {
    return rigid(shapes::box(Vec3::Zero(), {0.28, 0.2, 0.12}, voxel),
                 {kMiddle, Vec3(1, 2, 3).normalized(), 0.5 * kPi * time, Vec3::Zero(), 0.5 * kPi});
}

/// The neck closes and parts where the gap is 0.408: at about 0.31 and 0.69 of the time.
Moment blobs(double time, double voxel) {
    constexpr double kRadiusA = 0.18, kRadiusB = 0.14, kFillet = 0.05;
    const double gap = 0.3 + 0.35 * std::pow(std::cos(kPi * time), 2);
    const Vec3 axis(std::cos(0.5 * time), std::sin(0.5 * time), 0.0);
    const Vec3 a = kMiddle - 0.5 * (gap + kRadiusB - kRadiusA) * axis;
    return {shapes::blended_spheres(a, kRadiusA, a + gap * axis, kRadiusB, kFillet, voxel), {}};
}

/// The drop is there from half of the time on.
Moment birth(double time, double voxel) {
    const Vec3 drift(0.1, 0.0, 0.0), fall(0.0, 0.0, -0.3);
    const shapes::SurfacePtr body = shapes::sphere(Vec3(0.3, 0.4, 0.4) + time * drift, 0.2, voxel);
    if (time < 0.5) return {body, [drift](const Vec3&) { return drift; }};
    const Vec3 centre = Vec3(0.8, 0.75, 0.85) + (time - 0.5) * fall;
    const shapes::SurfacePtr drop = shapes::sphere(centre, 0.07, voxel);
    // Halfway between the two there is no band, so any border does.
    const auto velocity = [=](const Vec3& p) { return (p - centre).norm() < 0.2 ? fall : drift; };
    return {shapes::unite({body, drop}), velocity};
}

class FormulaSource final : public SampleSource {
public:
    using Formula = Moment (*)(double time, double voxel);

    FormulaSource(Formula formula, int frames, double voxel)
        : formula_(formula), step_(frame_step(frames)), voxel_(voxel) {}

    SampleFrame next() override {
        const Moment moment = formula_(step_ * frame_++, voxel_);
        SampleFrame frame;
        frame.surface = rasterise(*moment.solid, voxel_);
        if (moment.velocity) frame.velocity = sample_velocity(*frame.surface, moment.velocity, step_);
        return frame;
    }

private:
    Formula formula_;
    double step_, voxel_;
    int frame_ = 0;
};

template <FormulaSource::Formula formula>
std::unique_ptr<SampleSource> make_formula(int frames, double voxel, std::uint64_t) {
    return std::make_unique<FormulaSource>(formula, frames, voxel);
}

struct Entry {
    SampleShape shape;
    std::unique_ptr<SampleSource> (*make)(int frames, double voxel, std::uint64_t seed);
};

const std::vector<Entry>& entries() {
    static const std::vector<Entry> all{
        {{"sphere", "a sphere that moves and pulses", 0.01}, make_formula<sphere>},
        {{"ellipsoid", "an ellipsoid that turns and stretches, its volume kept", 0.01},
         make_formula<ellipsoid>},
        {{"torus", "a torus that tumbles", 0.01}, make_formula<torus>},
        {{"plate", "a thin disk that rises and sways", 0.01}, make_formula<plate>},
        {{"shell", "a hollow sphere that grows", 0.01}, make_formula<shell>},
        {{"box", "a box with sharp edges that turns", 0.01}, make_formula<box>},
        {{"blobs", "two drops that merge and split again", 0.01}, make_formula<blobs>},
        {{"birth", "a sphere, and halfway a drop that appears beside it", 0.01}, make_formula<birth>},
        {{"enright", "a sphere stretched to a thin sheet by Enright's deformation field, time 0 to 0.8",
          0.01},
         [](int frames, double voxel, std::uint64_t) { return make_enright(frames, voxel); }},
        {{"splash", "thousands of drops that leave a pool and fall back into it", 0.006}, make_splash},
    };
    return all;
}

const Entry& find_entry(const std::string& name) {
    std::string known;
    for (const Entry& entry : entries()) {
        if (entry.shape.name == name) return entry;
        known += (known.empty() ? "" : ", ") + entry.shape.name;
    }
    throw OptionError("unknown shape '" + name + "', expected one of: " + known);
}

}  // namespace

openvdb::Vec3SGrid::Ptr sample_velocity(const openvdb::FloatGrid& surface,
                                        const std::function<Vec3(const Vec3&)>& velocity, double factor) {
    const auto tree =
        std::make_shared<openvdb::Vec3STree>(surface.tree(), openvdb::Vec3s(0.0f), openvdb::TopologyCopy());
    auto grid = openvdb::Vec3SGrid::create(tree);
    grid->setTransform(surface.transform().copy());
    grid->setName("velocity");
    grid->setVectorType(openvdb::VEC_CONTRAVARIANT_RELATIVE);
    openvdb::tree::LeafManager<openvdb::Vec3STree> leaves(*tree);
    leaves.foreach ([&](openvdb::Vec3STree::LeafNodeType& leaf, std::size_t) {
        for (auto voxel = leaf.beginValueOn(); voxel; ++voxel) {
            const openvdb::Vec3d p = grid->indexToWorld(voxel.getCoord());
            const Vec3 v = factor * velocity(Vec3(p.x(), p.y(), p.z()));
            voxel.setValue(openvdb::Vec3s(openvdb::Vec3d(v.data())));
        }
    });
    return grid;
}

const std::vector<SampleShape>& sample_shapes() {
    static const std::vector<SampleShape> shapes = [] {
        std::vector<SampleShape> list;
        for (const Entry& entry : entries()) list.push_back(entry.shape);
        return list;
    }();
    return shapes;
}

struct SampleSequence::Impl {
    int frames, done = 0;
    std::unique_ptr<SampleSource> source;
};

SampleSequence::SampleSequence(const std::string& shape, const SampleSequenceOptions& options) {
    const Entry& entry = find_entry(shape);
    if (options.frames < 1)
        throw OptionError("the number of frames must be at least 1, got " + std::to_string(options.frames));
    const double voxel = options.voxel.value_or(entry.shape.default_voxel);
    if (!(voxel >= kSmallestVoxel && voxel <= kLargestVoxel))
        throw OptionError("the voxel size must be from 0.0001 to 0.1, got " + std::to_string(voxel));
    impl_ = std::make_unique<Impl>(Impl{options.frames, 0, entry.make(options.frames, voxel, options.seed)});
}

SampleSequence::~SampleSequence() = default;

int SampleSequence::size() const {
    return impl_->frames;
}

SampleFrame SampleSequence::next() {
    if (impl_->done == impl_->frames) throw std::out_of_range("the sample sequence has no more frames");
    ++impl_->done;
    SampleFrame frame = impl_->source->next();
    frame.surface->setName("surface");
    return frame;
}

}  // namespace isotrack
