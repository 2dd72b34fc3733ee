#include "isotrack/sampling/particles.h"

namespace isotrack {
namespace {

template <typename T>
void compact(std::vector<T>& values, const std::vector<char>& keep) {
    std::size_t to = 0;
    for (std::size_t from = 0; from < values.size(); ++from)
        if (keep[from]) values[to++] = values[from];
    values.resize(to);
}

}  // namespace

void Particles::add(const Vec3& p, const Vec3& n, double h, Id new_id, const Vec3& v) {
    position.push_back(p);
    normal.push_back(n);
    spacing.push_back(h);
    id.push_back(new_id);
    velocity.push_back(v);
}

void Particles::retain(const std::vector<char>& keep) {
    compact(position, keep);
    compact(normal, keep);
    compact(spacing, keep);
    compact(id, keep);
    compact(velocity, keep);
}

void Particles::clear() { *this = {}; }

}  // namespace isotrack
