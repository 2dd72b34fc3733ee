#include "meshing/torn_components.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <utility>

#include "meshing/lattice_neighbours.h"

namespace isotrack {
namespace {

constexpr double kSmall = 4.0;            // lattice units, the largest extent
constexpr std::size_t kMostBetween = 32;  // nodes that no part of the mesh holds

struct Piece {
    int component;
    std::vector<Node> nodes;  // that it holds, ascending
};

/// The small components, those with the fewest nodes first.
std::vector<Piece> small_pieces(const MeshLines& lines, const std::vector<Vec3>& points,
                                const std::vector<Triangle>& triangles, const std::vector<int>& component,
                                const std::vector<char>& is_part) {
    std::vector<Box> boxes(is_part.size());
    for (std::size_t t = 0; t < triangles.size(); ++t)
        for (const int v : triangles[t]) boxes[component[t]].extend(points[v]);
    std::vector<Piece> result;
    for (std::size_t c = 0; c < boxes.size(); ++c) {
        if (!is_part[c] || !(boxes[c].sizes().maxCoeff() <= kSmall)) continue;
        Piece piece{static_cast<int>(c), {}};
        const Vec3 from = boxes[c].min().array().floor(), to = boxes[c].max().array().ceil();
        for (int x = static_cast<int>(from.x()); x <= to.x(); ++x)
            for (int y = static_cast<int>(from.y()); y <= to.y(); ++y)
                MeshLines::for_each_pair(lines.line(x, y), [&](const auto& in, const auto& out) {
                    if (in.component != piece.component) return;
                    for (int z = static_cast<int>(std::ceil(in.z)); z <= out.z; ++z)
                        piece.nodes.push_back({x, y, z});
                });
        if (!piece.nodes.empty()) result.push_back(std::move(piece));
    }
    std::stable_sort(result.begin(), result.end(),
                     [](const Piece& a, const Piece& b) { return a.nodes.size() < b.nodes.size(); });
    return result;
}

}  // namespace

std::vector<int> torn_components(const MeshLines& lines, const std::vector<Vec3>& points,
                                 const std::vector<Triangle>& triangles, const std::vector<int>& component,
                                 const std::vector<char>& is_part, const LatticeSides& sides) {
    std::vector<int> torn;
    if (std::count(is_part.begin(), is_part.end(), 1) < 2) return torn;
    std::vector<char> rest = is_part;
    const Eigen::Affine3d lattice = sides.surface().lattice();
    const auto probe = sides.surface().probe();
    const auto is_inside = [&](const Node& n) {
        return probe->value(lattice * Vec3(n[0], n[1], n[2])) < 0.0;
    };
    const auto is_of_rest = [&](const Node& n, int but_for) {
        const auto [begin, end] = lines.line(n[0], n[1]);
        return std::count_if(begin, end,
                             [&](const MeshLines::Hit& h) {
                                 return h.z < n[2] && rest[h.component] && h.component != but_for;
                             }) %
                   2 ==
               1;
    };
    // Calls `visit` with the inside nodes that an inside node is joined with, until one says that this is
    // enough.
    const auto any_joined = [&](const Node node, const auto& visit) {
        std::vector<Node> steps;
        std::uint32_t inside = 1u << bit_of(0, 0, 0);
        for (int x = -1; x <= 1; ++x)
            for (int y = -1; y <= 1; ++y)
                for (int z = -1; z <= 1; ++z) {
                    if ((x == 0 && y == 0 && z == 0) || !is_inside({node[0] + x, node[1] + y, node[2] + z}))
                        continue;
                    inside |= 1u << bit_of(x, y, z);
                    steps.push_back({x, y, z});
                }
        return std::any_of(steps.begin(), steps.end(), [&](const Node& step) {
            return is_joined(inside, step) &&
                   visit(Node{node[0] + step[0], node[1] + step[1], node[2] + step[2]});
        });
    };
    const auto hangs_on_rest = [&](const Piece& piece) {
        // Within the rest, as a void is, it is not torn off it.
        if (is_of_rest(piece.nodes.front(), piece.component)) return false;
        std::vector<Node> hanging;
        std::copy_if(piece.nodes.begin(), piece.nodes.end(), std::back_inserter(hanging), is_inside);
        const std::size_t most = hanging.size() + kMostBetween;
        for (std::size_t i = 0; i < hanging.size(); ++i)
            if (any_joined(hanging[i], [&](const Node& other) {
                    if (is_of_rest(other, piece.component)) return true;
                    if (hanging.size() < most &&
                        std::find(hanging.begin(), hanging.end(), other) == hanging.end())
                        hanging.push_back(other);
                    return false;
                }))
                return true;
        return false;
    };
    for (const Piece& piece : small_pieces(lines, points, triangles, component, is_part)) {
        if (!hangs_on_rest(piece)) continue;
        torn.push_back(piece.component);
        rest[piece.component] = 0;
    }
    return torn;
}

}  // namespace isotrack
