#include "meshing/spoilt_steps.h"

#include <utility>

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

void undo_spoilt_steps(const std::vector<Vec3>& vertices, std::vector<Vec3>& to,
                       const std::vector<Triangle>& triangles, const std::vector<char>& movable) {
    const auto spoilt_among = [&](const auto& is_looked_at) {
        constexpr std::size_t kTrianglesPerBlock = 1024;
        return find_in_blocks<int>(
            triangles.size(), kTrianglesPerBlock,
            [&](std::size_t begin, std::size_t end, std::vector<int>& found) {
                for (std::size_t t = begin; t < end; ++t) {
                    const auto& [i, j, k] = triangles[t];
                    if (is_looked_at(triangles[t]) &&
                        spoilt(vertices[i], vertices[j], vertices[k], to[i], to[j], to[k]))
                        found.push_back(static_cast<int>(t));
                }
            });
    };
    // All triangles, then those around what was undone: to look for them in all costs less than to list them.
    std::vector<int> bad = spoilt_among([](const Triangle&) { return true; });
    std::vector<char> undone(bad.empty() ? 0 : vertices.size(), 0);  // in this pass
    for (int pass = 0; !bad.empty(); ++pass) {
        std::vector<int> back;
        for (const int t : bad)
            for (const int v : triangles[t])
                if (movable[v] && !std::exchange(undone[v], 1)) back.push_back(v);
        for (const int v : back) to[v] = pass < kHalvings ? Vec3(0.5 * (vertices[v] + to[v])) : vertices[v];
        bad = spoilt_among([&](const Triangle& t) { return undone[t[0]] || undone[t[1]] || undone[t[2]]; });
        for (const int v : back) undone[v] = 0;
    }
}

}  // namespace isotrack
