#include "tracking/patching.h"

#include <algorithm>
#include <array>
#include <map>

#include "disjoint_sets.h"
#include "tracking/triangle_index.h"

namespace isotrack {

std::vector<Vec3> apart(const std::vector<Vec3>& places, double distance, std::size_t most) {
    std::map<std::array<double, 3>, std::vector<Vec3>> in_cube;
    std::vector<Vec3> result;
    for (const Vec3& place : places) {
        if (result.size() == most) break;
        const Vec3 cube = (place / distance).array().floor();
        bool is_near = false;
        for (int n = 0; n < 27; ++n) {
            const Vec3 other = cube + Vec3(n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1);
            const auto found = in_cube.find({other.x(), other.y(), other.z()});
            is_near = is_near || (found != in_cube.end() &&
                                  std::any_of(found->second.begin(), found->second.end(),
                                              [&](const Vec3& p) { return (p - place).norm() < distance; }));
        }
        if (is_near) continue;
        in_cube[{cube.x(), cube.y(), cube.z()}].push_back(place);
        result.push_back(place);
    }
    return result;
}

FrameMesh patched(FrameMesh mesh, const std::vector<const Patch*>& patches) {
    const int before = static_cast<int>(mesh.vertices.size());
    std::vector<char> gone(mesh.carved.triangles.size(), 0);
    for (const Patch* patch : patches) {
        const int shift = static_cast<int>(mesh.vertices.size()) - before;
        std::vector<Triangle> coming = patch->triangles;
        for (Triangle& t : coming)
            for (int& v : t)
                if (v >= before) v += shift;
        append(mesh, patch->points, coming);
        for (const int t : patch->gone) gone[t] = 1;
    }
    gone.resize(mesh.carved.triangles.size(), 0);
    return without(std::move(mesh), gone);
}

std::vector<Vec3> corners_of(const Patch& patch, const FrameMesh& mesh) {
    std::vector<Vec3> result;
    for (const Triangle& t : patch.triangles)
        for (const int v : from_least_corner(t)) {
            const auto number = static_cast<std::size_t>(v), old = mesh.vertices.size();
            result.push_back(number < old ? mesh.vertices[number] : patch.points[number - old]);
        }
    return result;
}

bool has_flat_triangle(const std::vector<Vec3>& corners) {
    constexpr double kFlat = 1e-3;  // twice the area over the square of the longest edge
    for (std::size_t c = 0; c < corners.size(); c += 3) {
        const Vec3 a = corners[c + 1] - corners[c], b = corners[c + 2] - corners[c];
        const double longest2 = std::max({a.squaredNorm(), b.squaredNorm(), (b - a).squaredNorm()});
        if (!(a.cross(b).norm() > kFlat * longest2)) return true;
    }
    return false;
}

MeshNumbers numbers_of(const FrameMesh& mesh) {
    DisjointSets sets(mesh.vertices.size());
    long components = static_cast<long>(mesh.vertices.size());
    for (const Triangle& t : mesh.carved.triangles)
        for (const int v : {t[1], t[2]}) components -= sets.join(t[0], v);
    return {components, euler_of(mesh)};
}

}  // namespace isotrack
