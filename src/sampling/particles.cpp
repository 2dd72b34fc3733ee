#include "isotrack/sampling/particles.h"

#include "sampling/compact.h"

namespace isotrack {

void Particles::add(const Vec3& p, const Vec3& n, double h, Id new_id, const Vec3& v) {
    position.push_back(p);
    normal.push_back(n);
    spacing.push_back(h);
    stretch.push_back(Vec3::Zero());
    id.push_back(new_id);
    velocity.push_back(v);
}

void Particles::retain(const std::vector<char>& keep) {
    compact(position, keep);
    compact(normal, keep);
    compact(spacing, keep);
    compact(stretch, keep);
    compact(id, keep);
    compact(velocity, keep);
}

void Particles::clear() {
    *this = {};
}

}  // namespace isotrack
