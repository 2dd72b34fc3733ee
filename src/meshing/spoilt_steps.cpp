#include "meshing/spoilt_steps.h"

#include "find_in_blocks.h"
#include "meshing/sharpness.h"

namespace isotrack {
namespace {

constexpr int kHalvings = 2;  // of the steps around a spoilt triangle, before they are taken back

/// Whether a triangle turns over by these steps, or gets too sharp and sharper than it was.
bool spoilt(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& a_to, const Vec3& b_to,
            const Vec3& c_to) {
    // What has no sharp angle after steps of a tenth of its edges has not turned over.
    if (!is_sharper(kSharpnessAt30Degrees, a_to, b_to, c_to)) return false;
    const Vec3 area = (b - a).cross(c - a);
    if (area == Vec3::Zero()) return false;
    if (!(area.dot((b_to - a_to).cross(c_to - a_to)) > 0.0)) return true;
    return sharpness(a_to, b_to, c_to) > sharpness(a, b, c);
}

}  // namespace

void SpoiltSteps::undo(const std::vector<Vec3>& vertices, std::vector<Vec3>& to) {
    const auto spoilt_among = [&](const auto& is_looked_at) {
        constexpr std::size_t kTrianglesPerBlock = 1024;
        return find_in_blocks<int>(
            triangles_.size(), kTrianglesPerBlock,
            [&](std::size_t begin, std::size_t end, std::vector<int>& found) {
                for (std::size_t t = begin; t < end; ++t) {
                    const auto& [i, j, k] = triangles_[t];
                    if (is_looked_at(triangles_[t]) &&
                        spoilt(vertices[i], vertices[j], vertices[k], to[i], to[j], to[k]))
                        found.push_back(static_cast<int>(t));
                }
            });
    };
    // All triangles, then those around what was undone: to look for them in all costs less than to list them.
    std::vector<int> bad = spoilt_among([](const Triangle&) { return true; });
    for (int pass = 0; !bad.empty(); ++pass) {
        for (const int t : bad)
            for (const int v : triangles_[t])
                if (movable_[v]) back_.add(v);
        for (const int v : back_.list())
            to[v] = pass < kHalvings ? Vec3(0.5 * (vertices[v] + to[v])) : vertices[v];
        bad = spoilt_among(
            [&](const Triangle& t) { return back_.has(t[0]) || back_.has(t[1]) || back_.has(t[2]); });
        back_.clear();
    }
}

}  // namespace isotrack
