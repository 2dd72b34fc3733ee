// Tracks a surface given by a formula of one's own instead of a grid: a ring whose thickness swells and
// shrinks in three places. What the tracker asks of a surface are a value, a gradient, and the projection O1;
// the normal O2 follows from the gradient.
#include <isotrack/surface/surface.h>
#include <isotrack/tracking/tracker.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <optional>

using namespace isotrack;

namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kRingRadius = 1.0;      // of the circle in the middle of the ring
constexpr double kMeanThickness = 0.35;  // radius of the tube
constexpr double kSwelling = 0.1;
constexpr double kTolerance = 0.01;  // all of them world units

/// The points at the distance r(angle) = mean + swelling cos(3 angle) from a circle in the plane z = 0. The
/// slope of r makes the gradient up to a tenth longer than 1, so the value is a distance to that accuracy.
class SwellingRing : public Surface {
public:
    explicit SwellingRing(double swelling) : swelling_(swelling) {}

    std::unique_ptr<Probe> probe() const override { return std::make_unique<RingProbe>(swelling_); }
    double resolution() const override { return 0.05; }
    double reach() const override { return 0.2; }  // short of the circle and the z axis
    Box bounds() const override {
        const double r = kMeanThickness + std::abs(swelling_);
        const Vec3 corner(kRingRadius + r, kRingRadius + r, r);
        return Box(-corner, corner);
    }

private:
    class RingProbe : public Probe {
    public:
        explicit RingProbe(double swelling) : Probe(1e-9, 0.05), swelling_(swelling) {}

        double value(const Vec3& p) override {
            return (p - nearest_on_circle(p)).norm() - thickness(angle(p));
        }

        Sample sample(const Vec3& p) override {
            const double a = angle(p), rho = std::hypot(p.x(), p.y());
            const Vec3 out = p - nearest_on_circle(p);
            if (rho == 0.0 || out.isZero(0.0)) return {value(p), Vec3::Zero()};
            const Vec3 along(-std::sin(a), std::cos(a), 0.0);
            const double slope = -3.0 * swelling_ * std::sin(3.0 * a);  // dr / da
            return {out.norm() - thickness(a), out.normalized() - slope / rho * along};
        }

        // No iteration needed: within its half-plane through the z axis the tube is a circle.
        std::optional<Vec3> project(const Vec3& p) override {
            const Vec3 middle = nearest_on_circle(p), out = p - middle;
            if (out.isZero(0.0)) return std::nullopt;
            return middle + thickness(angle(p)) * out.normalized();
        }

    private:
        static double angle(const Vec3& p) { return std::atan2(p.y(), p.x()); }
        static Vec3 nearest_on_circle(const Vec3& p) {
            return kRingRadius * Vec3(std::cos(angle(p)), std::sin(angle(p)), 0.0);
        }
        double thickness(double a) const { return kMeanThickness + swelling_ * std::cos(3.0 * a); }

        double swelling_;
    };

    double swelling_;
};

void track() {
    constexpr int kFrames = 20;
    TrackerOptions options;
    options.tolerance = kTolerance;
    Tracker tracker(options);
    std::printf("frame  particles  triangles    born    died     error  (tolerance %g)\n", kTolerance);
    for (int frame = 0; frame < kFrames; ++frame) {
        const SwellingRing ring(kSwelling * std::cos(2.0 * kPi * frame / kFrames));
        const TrackedFrame result = tracker.advance(ring);
        std::printf("%5d  %9zu  %9zu  %6zu  %6zu  %8.5f%s\n", frame, result.particles,
                    result.mesh.triangles.size(), result.born, result.died, result.max_error,
                    result.within_tolerance ? "" : "  too large");
    }
}

}  // namespace

int main() {
    try {
        track();
    } catch (const std::exception& error) {
        std::fprintf(stderr, "%s\n", error.what());
        return EXIT_FAILURE;
    }
    return EXIT_SUCCESS;
}
