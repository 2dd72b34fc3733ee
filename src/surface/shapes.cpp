#include "isotrack/surface/shapes.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "isotrack/error.h"

namespace isotrack::shapes {
namespace {

/// The surface point closest to a query, and with it all that an exact signed distance has to tell.
struct Closest {
    Vec3 point;
    double distance;  // negative inside
    Vec3 gradient;    // of the distance, at the query; where several points are closest, that of one of them
};

void require_positive(double value, const char* what) {
    if (!(value > 0.0) || !std::isfinite(value))
        throw OptionError(std::string(what) + " must be a positive length, got " + std::to_string(value));
}

/// The direction of `v`, or `fallback` where it has none.
Vec3 direction_or(const Vec3& v, const Vec3& fallback) {
    const double length = v.norm();
    return length > 0.0 ? Vec3(v / length) : fallback;
}

Box centred_box(const Vec3& half_sizes) {
    return {-half_sizes, half_sizes};
}

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return a.x() * b.y() - a.y() * b.x();
}

// The forms, each at the origin of its own space.

struct Ball {
    double radius;

    Box bounds() const { return centred_box(Vec3::Constant(radius)); }
    Closest closest(const Vec3& p) const {
        const Vec3 n = direction_or(p, Vec3::UnitZ());
        return {radius * n, p.norm() - radius, n};
    }
};

struct Torus {
    double major, minor;

    Box bounds() const { return centred_box({major + minor, major + minor, minor}); }
    Closest closest(const Vec3& p) const {
        const Vec3 outward = direction_or(Vec3(p.x(), p.y(), 0.0), Vec3::UnitX());
        const Vec3 on_circle = major * outward;
        const Vec3 n = direction_or(p - on_circle, outward);
        return {on_circle + minor * n, (p - on_circle).norm() - minor, n};
    }
};

/// All points closer than half the thickness to a flat disk.
struct Plate {
    double radius, thickness;

    Box bounds() const { return centred_box({radius, radius, 0.5 * thickness}); }
    Closest closest(const Vec3& p) const {
        const double half = 0.5 * thickness;
        const Vec3 flat(p.x(), p.y(), 0.0);
        const double r = flat.norm(), disk = radius - half;
        const Vec3 on_disk = r > disk ? Vec3(flat * (disk / r)) : flat;
        const Vec3 n = direction_or(p - on_disk, Vec3::UnitZ());
        return {on_disk + half * n, (p - on_disk).norm() - half, n};
    }
};

struct Shell {
    double outer, thickness;

    Box bounds() const { return centred_box(Vec3::Constant(outer)); }
    Closest closest(const Vec3& p) const {
        const double r = p.norm(), inner = outer - thickness;
        const Vec3 n = direction_or(p, Vec3::UnitZ());
        if (r - inner < outer - r) return {inner * n, inner - r, -n};
        return {outer * n, r - outer, n};
    }
};

struct Cuboid {
    Vec3 half;

    Box bounds() const { return centred_box(half); }
    Closest closest(const Vec3& p) const {
        const Vec3 beyond = p.cwiseAbs() - half;
        int axis = 0;
        if (beyond.maxCoeff(&axis) > 0.0) {
            const Vec3 q = p.cwiseMax(-half).cwiseMin(half);
            return {q, (p - q).norm(), (p - q).normalized()};
        }
        const double side = p[axis] < 0.0 ? -1.0 : 1.0;
        Vec3 q = p;
        q[axis] = side * half[axis];
        return {q, beyond[axis], side * Vec3::Unit(axis)};
    }
};

/// Closest points as in D. Eberly, "Distance from a point to an ellipse, an ellipsoid, or a hyperellipsoid":
/// with z = |p| / e and r = (e / e_min)^2, the point x_i = e_i r_i z_i / (u + r_i - 1) where u >= 0 solves
/// sum (r_i z_i / (u + r_i - 1))^2 = 1. (Eberly's s is u - 1: kept this way, small u lose no digits.)
struct Ellipsoid {
    Vec3 half_axes;

    Box bounds() const { return centred_box(half_axes); }
    Closest closest(const Vec3& p) const {
        int shortest = 0;
        const double e_min = half_axes.minCoeff(&shortest);
        const Vec3 z = p.cwiseAbs().cwiseQuotient(half_axes);
        const Vec3 r = (half_axes / e_min).cwiseAbs2();

        Vec3 on_unit_sphere;  // x_i / e_i
        const auto evaluate = [&](double u) {
            for (int i = 0; i < 3; ++i)
                on_unit_sphere[i] = z[i] > 0.0 ? r[i] * z[i] / (u + (r[i] - 1.0)) : 0.0;
            return on_unit_sphere.squaredNorm() - 1.0;
        };

        // Each term alone reaches 1 at or left of the root, so the largest of these places is left of it too.
        // The function falls and is convex: from there Newton climbs to the root without ever passing it.
        double u = (r.cwiseProduct(z) - (r - Vec3::Ones())).maxCoeff();
        double g = evaluate(u);
        if (u == 0.0 && g < 0.0) {
            // In the plane of symmetry across the shortest axis, too deep inside for any root: two closest
            // points, at u = 0, mirror images of each other.
            on_unit_sphere[shortest] = std::sqrt(-g);
        } else {
            constexpr int kMaxRounds =
                100;  // far from the root a round gains a factor 1.5, near it digits double
            for (int round = 0; round < kMaxRounds && g > 0.0; ++round) {
                double slope = 0.0;
                for (int i = 0; i < 3; ++i)
                    if (z[i] > 0.0) slope -= 2.0 * on_unit_sphere[i] * on_unit_sphere[i] / (u + (r[i] - 1.0));
                const double next = u - g / slope;
                if (!(next > u)) break;
                u = next;
                g = evaluate(u);
            }
        }
        on_unit_sphere.normalize();
        for (int i = 0; i < 3; ++i)
            if (p[i] < 0.0) on_unit_sphere[i] = -on_unit_sphere[i];
        const Vec3 q = half_axes.cwiseProduct(on_unit_sphere);
        const Vec3 n = on_unit_sphere.cwiseQuotient(half_axes).normalized();
        const double distance = (p - q).norm();
        return {q, z.squaredNorm() < 1.0 ? -distance : distance, n};
    }
};

/// What a ball of radius `fillet` cannot enter without entering one of two balls around 0 and (0, 0, gap): in
/// the half plane of (axis, radius) two circles, and one around `corner_` that touches both from outside.
/// Where this one reaches across the axis there is no neck: it cuts the solid in two drops with pointed ends.
class BallPair {
public:
    BallPair(double radius_a, double radius_b, double gap, double fillet)
        : radius_a_(radius_a), radius_b_(radius_b), gap_(gap), fillet_(fillet) {
        const double reach_a = radius_a + fillet, reach_b = radius_b + fillet;
        if (!(gap * gap > std::abs(reach_a * reach_a - reach_b * reach_b)))
            throw OptionError("the spheres of a pair must lie beside each other, their centres are only " +
                              std::to_string(gap) + " apart");
        const double along = (gap * gap + reach_a * reach_a - reach_b * reach_b) / (2.0 * gap);
        const double height_squared = reach_a * reach_a - along * along;
        is_blended_ = height_squared > 0.0;
        corner_ = {along, is_blended_ ? std::sqrt(height_squared) : 0.0};
    }

    Box bounds() const {
        const Vec3 a = Vec3::Constant(radius_a_), b = Vec3::Constant(radius_b_), at_b(0.0, 0.0, gap_);
        return Box(-a, a).extend(at_b - b).extend(at_b + b);
    }
    Closest closest(const Vec3& p) const {
        const Vec3 flat(p.x(), p.y(), 0.0);
        const Vec3 outward = direction_or(flat, Vec3::UnitX());
        const Planar planar = planar_closest({p.z(), flat.norm()});
        const auto to_space = [&](const Vec2& v) { return Vec3(v.x() * Vec3::UnitZ() + v.y() * outward); };
        return {to_space(planar.point), planar.distance, to_space(planar.gradient)};
    }

private:
    using Vec2 = Eigen::Vector2d;  // (axis, radius)
    struct Planar {
        Vec2 point;
        double distance;
        Vec2 gradient;
    };

    // The surface is smooth but for the pointed ends, so the closest point is either one of these or lies
    // where the arc's own circle has it. The rays from the centres to the corner pass through the points
    // where the arcs meet.
    Planar planar_closest(const Vec2& q) const {
        const Vec2 a(0.0, 0.0), b(gap_, 0.0);
        const Planar on_a = on_circle(q, a, radius_a_), on_b = on_circle(q, b, radius_b_);
        const Planar& nearer = on_a.distance <= on_b.distance ? on_a : on_b;
        if (!is_blended_) return nearer;
        const bool faces_a = cross(corner_ - a, q - a) >= 0.0, faces_b = cross(corner_ - b, q - b) <= 0.0;
        if (faces_a && faces_b) return nearer;
        if (faces_a) return on_a;
        if (faces_b) return on_b;
        return on_fillet(q);
    }

    static Planar on_circle(const Vec2& q, const Vec2& centre, double radius) {
        const Vec2 v = q - centre;
        const double length = v.norm();
        const Vec2 n = length > 0.0 ? Vec2(v / length) : Vec2(0.0, 1.0);
        return {centre + radius * n, length - radius, n};
    }

    Planar on_fillet(const Vec2& q) const {
        const Planar ball = on_circle(q, corner_, fillet_);
        if (ball.point.y() >= 0.0) return {ball.point, -ball.distance, -ball.gradient};
        const double side = q.x() < corner_.x() ? -1.0 : 1.0;
        const double half_gap = std::sqrt(fillet_ * fillet_ - corner_.y() * corner_.y());
        const Vec2 tip(corner_.x() + side * half_gap, 0.0);
        const double distance = (q - tip).norm();
        return {tip, distance, distance > 0.0 ? Vec2((q - tip) / distance) : Vec2(-side, 0.0)};
    }

    double radius_a_, radius_b_, gap_, fillet_;
    Vec2 corner_;
    bool is_blended_;
};

// The surfaces.

/// What a Newton projection is content with, relative to the resolution.
constexpr double kProjectionTolerance = 1e-6;

/// A form at a place.
template <class Form>
class ClosedForm final : public Surface {
public:
    ClosedForm(const Form& form, const Vec3& centre, double resolution)
        : form_(form), centre_(centre), resolution_(resolution) {
        require_positive(resolution, "the resolution of a shape");
        if (!centre.allFinite()) throw OptionError("the centre of a shape must be finite");
    }

    std::unique_ptr<Probe> probe() const override { return std::make_unique<FormProbe>(*this); }
    double resolution() const override { return resolution_; }
    Box bounds() const override { return form_.bounds().translate(centre_); }

private:
    class FormProbe final : public Probe {
    public:
        explicit FormProbe(const ClosedForm& surface)
            : Probe(kProjectionTolerance * surface.resolution_, surface.resolution_), surface_(surface) {}

        double value(const Vec3& p) override { return closest(p).distance; }
        Sample sample(const Vec3& p) override {
            const Closest at = closest(p);
            return {at.distance, at.gradient};
        }
        std::optional<Vec3> project(const Vec3& p) override { return surface_.centre_ + closest(p).point; }
        Vec3 normal(const Vec3& p) override { return closest(p).gradient; }

    private:
        Closest closest(const Vec3& p) const { return surface_.form_.closest(p - surface_.centre_); }
        const ClosedForm& surface_;
    };

    Form form_;
    Vec3 centre_;
    double resolution_;
};

template <class Form>
SurfacePtr place(const Form& form, const Vec3& centre, double resolution) {
    return std::make_shared<ClosedForm<Form>>(form, centre, resolution);
}

class FunctionSurface final : public Surface {
public:
    FunctionSurface(std::function<double(const Vec3&)> value, const Box& bounds, double resolution)
        : value_(std::move(value)), bounds_(bounds), resolution_(resolution) {
        if (!value_) throw OptionError("a surface needs a function");
        require_positive(resolution, "the resolution of a shape");
    }

    std::unique_ptr<Probe> probe() const override { return std::make_unique<FunctionProbe>(*this); }
    double resolution() const override { return resolution_; }
    Box bounds() const override { return bounds_; }

private:
    class FunctionProbe final : public Probe {
    public:
        explicit FunctionProbe(const FunctionSurface& surface)
            : Probe(kProjectionTolerance * surface.resolution_, surface.resolution_), surface_(surface) {}

        double value(const Vec3& p) override { return surface_.value_(p); }
        Sample sample(const Vec3& p) override {
            const double step = 1e-4 * surface_.resolution_;
            Vec3 gradient;
            for (int i = 0; i < 3; ++i) {
                const Vec3 d = step * Vec3::Unit(i);
                gradient[i] = (surface_.value_(p + d) - surface_.value_(p - d)) / (2.0 * step);
            }
            return {surface_.value_(p), gradient};
        }

    private:
        const FunctionSurface& surface_;
    };

    std::function<double(const Vec3&)> value_;
    Box bounds_;
    double resolution_;
};

class MovedSurface final : public Surface {
public:
    MovedSurface(SurfacePtr solid, const Eigen::Isometry3d& motion)
        : solid_(std::move(solid)), motion_(motion) {
        if (!solid_) throw OptionError("there is no solid to move");
    }

    std::unique_ptr<Probe> probe() const override { return std::make_unique<MovedProbe>(*this); }
    double resolution() const override { return solid_->resolution(); }
    double reach() const override { return solid_->reach(); }
    double slope() const override { return solid_->slope(); }
    Box bounds() const override {
        const Box inner = solid_->bounds();
        Box outer;
        if (inner.isEmpty()) return outer;
        for (int corner = 0; corner < 8; ++corner)
            outer.extend(motion_ * inner.corner(static_cast<Box::CornerType>(corner)));
        return outer;
    }

private:
    class MovedProbe final : public Probe {
    public:
        explicit MovedProbe(const MovedSurface& surface)
            : Probe(kProjectionTolerance * surface.resolution(), surface.resolution()),
              inner_(surface.solid_->probe()),
              forward_(surface.motion_),
              back_(surface.motion_.inverse()) {}

        double value(const Vec3& p) override { return inner_->value(back_ * p); }
        double farther_value(const Vec3& p) override { return inner_->farther_value(back_ * p); }
        Sample sample(const Vec3& p) override {
            const Sample at = inner_->sample(back_ * p);
            return {at.value, forward_.linear() * at.gradient};
        }
        std::optional<Vec3> project(const Vec3& p) override {
            const std::optional<Vec3> q = inner_->project(back_ * p);
            if (!q) return std::nullopt;
            return forward_ * *q;
        }
        Vec3 normal(const Vec3& p) override { return forward_.linear() * inner_->normal(back_ * p); }

    private:
        std::unique_ptr<Probe> inner_;
        Eigen::Isometry3d forward_, back_;
    };

    SurfacePtr solid_;
    Eigen::Isometry3d motion_;
};

class UnionSurface final : public Surface {
public:
    explicit UnionSurface(std::vector<SurfacePtr> parts) : parts_(std::move(parts)) {
        if (parts_.empty()) throw OptionError("a union needs at least one part");
        for (const SurfacePtr& part : parts_)
            if (!part) throw OptionError("a part of a union is missing");
    }

    std::unique_ptr<Probe> probe() const override { return std::make_unique<UnionProbe>(*this); }
    double resolution() const override {
        double finest = parts_.front()->resolution();
        for (const SurfacePtr& part : parts_) finest = std::min(finest, part->resolution());
        return finest;
    }
    double reach() const override {
        double reach = parts_.front()->reach();
        for (const SurfacePtr& part : parts_) reach = std::min(reach, part->reach());
        return reach;
    }
    double slope() const override {
        double slope = 1.0;
        for (const SurfacePtr& part : parts_) slope = std::min(slope, part->slope());
        return slope;
    }
    Box bounds() const override {
        Box box;
        for (const SurfacePtr& part : parts_) box.extend(part->bounds());
        return box;
    }

private:
    class UnionProbe final : public Probe {
    public:
        explicit UnionProbe(const UnionSurface& surface)
            : Probe(kProjectionTolerance * surface.resolution(), surface.resolution()),
              buried_below_(-kProjectionTolerance * surface.resolution()) {
            for (const SurfacePtr& part : surface.parts_) parts_.push_back(part->probe());
        }

        double value(const Vec3& p) override { return parts_[lowest(p)]->value(p); }
        double farther_value(const Vec3& p) override {
            double least = parts_.front()->farther_value(p);
            for (const auto& part : parts_) least = std::min(least, part->farther_value(p));
            return least;
        }
        Sample sample(const Vec3& p) override { return parts_[lowest(p)]->sample(p); }
        std::optional<Vec3> project(const Vec3& p) override {
            std::optional<Vec3> best;
            for (const auto& part : parts_) {
                const std::optional<Vec3> q = part->project(p);
                if (!q || (best && (*best - p).norm() <= (*q - p).norm())) continue;
                if (value(*q) >= buried_below_)
                    best = q;  // else inside another part, no surface of the union
            }
            return best ? best : Probe::project(p);
        }

    private:
        std::size_t lowest(const Vec3& p) const {
            std::size_t best = 0;
            double least = parts_[0]->value(p);
            for (std::size_t i = 1; i < parts_.size(); ++i) {
                const double value = parts_[i]->value(p);
                if (value < least) least = value, best = i;
            }
            return best;
        }
        std::vector<std::unique_ptr<Probe>> parts_;
        double buried_below_;
    };

    std::vector<SurfacePtr> parts_;
};

}  // namespace

SurfacePtr from_function(std::function<double(const Vec3&)> value, const Box& bounds, double resolution) {
    return std::make_shared<FunctionSurface>(std::move(value), bounds, resolution);
}

SurfacePtr sphere(const Vec3& centre, double radius, double resolution) {
    require_positive(radius, "the radius of a sphere");
    return place(Ball{radius}, centre, resolution);
}

SurfacePtr ellipsoid(const Vec3& centre, const Vec3& half_axes, double resolution) {
    for (int i = 0; i < 3; ++i) require_positive(half_axes[i], "a half axis of an ellipsoid");
    return place(Ellipsoid{half_axes}, centre, resolution);
}

SurfacePtr torus(const Vec3& centre, double major_radius, double minor_radius, double resolution) {
    require_positive(minor_radius, "the minor radius of a torus");
    require_positive(major_radius - minor_radius, "the hole of a torus");
    return place(Torus{major_radius, minor_radius}, centre, resolution);
}

SurfacePtr box(const Vec3& centre, const Vec3& half_sizes, double resolution) {
    for (int i = 0; i < 3; ++i) require_positive(half_sizes[i], "a half size of a box");
    return place(Cuboid{half_sizes}, centre, resolution);
}

SurfacePtr plate(const Vec3& centre, double radius, double thickness, double resolution) {
    require_positive(thickness, "the thickness of a plate");
    require_positive(radius - 0.5 * thickness, "the flat part of a plate");
    return place(Plate{radius, thickness}, centre, resolution);
}

SurfacePtr shell(const Vec3& centre, double outer_radius, double thickness, double resolution) {
    require_positive(thickness, "the thickness of a shell");
    require_positive(outer_radius - thickness, "the void of a shell");
    return place(Shell{outer_radius, thickness}, centre, resolution);
}

SurfacePtr blended_spheres(const Vec3& centre_a, double radius_a, const Vec3& centre_b, double radius_b,
                           double fillet, double resolution) {
    require_positive(radius_a, "the radius of a sphere");
    require_positive(radius_b, "the radius of a sphere");
    require_positive(fillet, "the fillet between two spheres");
    const Vec3 axis = centre_b - centre_a;
    const SurfacePtr upright =
        place(BallPair(radius_a, radius_b, axis.norm(), fillet), Vec3::Zero(), resolution);
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    const Vec3 z = axis.normalized(), x = z.unitOrthogonal();
    motion.linear() << x, z.cross(x), z;
    motion.translation() = centre_a;
    return moved(upright, motion);
}

SurfacePtr moved(SurfacePtr solid, const Eigen::Isometry3d& motion) {
    return std::make_shared<MovedSurface>(std::move(solid), motion);
}

SurfacePtr unite(std::vector<SurfacePtr> parts) {
    return std::make_shared<UnionSurface>(std::move(parts));
}

}  // namespace isotrack::shapes
