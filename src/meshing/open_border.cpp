#include "isotrack/meshing/open_border.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <tuple>

namespace isotrack {

std::size_t open_border(TriangleMesh& mesh, const std::vector<char>& at_border, Id& next_id) {
    const std::size_t before = mesh.triangles.size();
    mesh.triangles.erase(std::remove_if(mesh.triangles.begin(), mesh.triangles.end(),
                                        [&](const Triangle& t) {
                                            return at_border[t[0]] && at_border[t[1]] && at_border[t[2]];
                                        }),
                         mesh.triangles.end());
    if (mesh.triangles.size() == before) return 0;

    // Corners that hang together through edges at their vertex are one output vertex.
    std::vector<int> parent(3 * mesh.triangles.size());
    std::iota(parent.begin(), parent.end(), 0);
    const auto find = [&](int c) {
        while (parent[c] != c) c = parent[c] = parent[parent[c]];
        return c;
    };
    std::vector<std::array<int, 4>> edges;  // smaller vertex, larger vertex, corner at each
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
        for (int k = 0; k < 3; ++k) {
            int a = static_cast<int>(3 * t) + k, b = static_cast<int>(3 * t) + (k + 1) % 3;
            if (mesh.triangles[t][k] > mesh.triangles[t][(k + 1) % 3]) std::swap(a, b);
            edges.push_back({mesh.triangles[a / 3][a % 3], mesh.triangles[b / 3][b % 3], a, b});
        }
    std::sort(edges.begin(), edges.end());
    for (std::size_t e = 1; e < edges.size(); ++e)
        if (edges[e][0] == edges[e - 1][0] && edges[e][1] == edges[e - 1][1])
            for (const int end : {2, 3}) {
                const int a = find(edges[e][end]), b = find(edges[e - 1][end]);
                parent[std::max(a, b)] = std::min(a, b);
            }

    TriangleMesh result;
    std::vector<int> number(parent.size(), -1);
    std::vector<char> taken(mesh.points.size(), 0);
    for (std::size_t c = 0; c < parent.size(); ++c) {
        const int root = find(static_cast<int>(c)), v = mesh.triangles[c / 3][c % 3];
        if (number[root] < 0) {
            number[root] = static_cast<int>(result.points.size());
            result.points.push_back(mesh.points[v]);
            if (!mesh.ids.empty()) result.ids.push_back(taken[v] ? next_id++ : mesh.ids[v]);
            if (!mesh.velocities.empty()) result.velocities.push_back(mesh.velocities[v]);
            taken[v] = 1;
        }
        if (c % 3 == 0) result.triangles.emplace_back();
        result.triangles.back()[c % 3] = number[root];
    }
    const std::size_t gone = before - result.triangles.size();
    mesh = std::move(result);
    return gone;
}

}  // namespace isotrack
