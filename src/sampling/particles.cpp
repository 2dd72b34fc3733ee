#include "isotrack/sampling/particles.h"

#include "room.h"
#include "sampling/compact.h"

namespace isotrack {

void Particles::add(const Vec3& p, const Vec3& n, double h, Id new_id, const Vec3& v) {
    const auto append = [](auto& values, const auto& value) {
        ensure_room(values);
        values.push_back(value);
    };
    append(position, p);
    append(normal, n);
    append(spacing, h);
    append(stretch, Vec3(Vec3::Zero()));
    append(id, new_id);
    append(velocity, v);
}

void Particles::retain(const std::vector<char>& keep) {
    compact(position, keep);
    compact(normal, keep);
    compact(spacing, keep);
    compact(stretch, keep);
    compact(id, keep);
    compact(velocity, keep);
}

void Particles::reorder(const std::vector<int>& order) {
    isotrack::reorder(position, order);
    isotrack::reorder(normal, order);
    isotrack::reorder(spacing, order);
    isotrack::reorder(stretch, order);
    isotrack::reorder(id, order);
    isotrack::reorder(velocity, order);
}

void Particles::clear() {
    *this = {};
}

}  // namespace isotrack
