#include "meshing/torn_components.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <utility>

#include "meshing/lattice_neighbours.h"
#include "parallel_for_each.h"
#include "surface/thread_probes.h"

namespace isotrack {
namespace {

constexpr double kSmall = 4.0;            // lattice units, the largest extent
constexpr std::size_t kMostBetween = 32;  // nodes that no part of the mesh holds
constexpr std::size_t kGrain = 8;         // pieces

struct Piece {
    int component;
    Box box;
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
    for (std::size_t c = 0; c < boxes.size(); ++c)
        if (is_part[c] && boxes[c].sizes().maxCoeff() <= kSmall)
            result.push_back({static_cast<int>(c), boxes[c], {}});
    parallel_for_each(result.size(), kGrain, [&](std::size_t p) {
        Piece& piece = result[p];
        const Vec3 from = piece.box.min().array().floor(), to = piece.box.max().array().ceil();
        for (int x = static_cast<int>(from.x()); x <= to.x(); ++x)
            for (int y = static_cast<int>(from.y()); y <= to.y(); ++y)
                MeshLines::for_each_pair(lines.line(x, y), [&](const auto& in, const auto& out) {
                    if (in.component != piece.component) return;
                    for (int z = static_cast<int>(std::ceil(in.z)); z <= out.z; ++z)
                        piece.nodes.push_back({x, y, z});
                });
    });
    const auto is_empty = [](const Piece& piece) { return piece.nodes.empty(); };
    result.erase(std::remove_if(result.begin(), result.end(), is_empty), result.end());
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
    ThreadProbes probes(sides.surface());
    const auto is_inside = [&](const Node& n, Surface::Probe& probe) {
        return probe.value(lattice * Vec3(n[0], n[1], n[2])) < 0.0;
    };
    struct Look {
        bool hangs_on_rest = false;
        Eigen::AlignedBox2d seen;  // the lines that it depends on
    };
    const auto is_of_rest = [&](const Node& n, int but_for, Look& look) {
        look.seen.extend(Eigen::Vector2d(n[0], n[1]));
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
    const auto any_joined = [&](const Node node, Surface::Probe& probe, const auto& visit) {
        std::vector<Node> steps;
        std::uint32_t inside = 1u << bit_of(0, 0, 0);
        for (int x = -1; x <= 1; ++x)
            for (int y = -1; y <= 1; ++y)
                for (int z = -1; z <= 1; ++z) {
                    if ((x == 0 && y == 0 && z == 0) ||
                        !is_inside({node[0] + x, node[1] + y, node[2] + z}, probe))
                        continue;
                    inside |= 1u << bit_of(x, y, z);
                    steps.push_back({x, y, z});
                }
        return std::any_of(steps.begin(), steps.end(), [&](const Node& step) {
            return is_joined(inside, step) &&
                   visit(Node{node[0] + step[0], node[1] + step[1], node[2] + step[2]});
        });
    };
    const auto look_at = [&](const Piece& piece) {
        Look look;
        Surface::Probe& probe = probes.local();
        // Within the rest, as a void is, it is not torn off it.
        if (is_of_rest(piece.nodes.front(), piece.component, look)) return look;
        std::vector<Node> hanging;
        std::copy_if(piece.nodes.begin(), piece.nodes.end(), std::back_inserter(hanging),
                     [&](const Node& n) { return is_inside(n, probe); });
        const std::size_t most = hanging.size() + kMostBetween;
        for (std::size_t i = 0; i < hanging.size() && !look.hangs_on_rest; ++i)
            look.hangs_on_rest = any_joined(hanging[i], probe, [&](const Node& other) {
                if (is_of_rest(other, piece.component, look)) return true;
                if (hanging.size() < most &&
                    std::find(hanging.begin(), hanging.end(), other) == hanging.end())
                    hanging.push_back(other);
                return false;
            });
        return look;
    };
    const std::vector<Piece> pieces = small_pieces(lines, points, triangles, component, is_part);
    std::vector<Look> looks(pieces.size());
    parallel_for_each(pieces.size(), kGrain, [&](std::size_t p) { looks[p] = look_at(pieces[p]); });
    std::vector<Eigen::AlignedBox2d> gone;  // the lines of the torn ones: what saw them is out of date
    for (std::size_t p = 0; p < pieces.size(); ++p) {
        const bool is_stale = std::any_of(
            gone.begin(), gone.end(),
            [&](const Eigen::AlignedBox2d& lines_there) { return lines_there.intersects(looks[p].seen); });
        if (!(is_stale ? look_at(pieces[p]) : looks[p]).hangs_on_rest) continue;
        torn.push_back(pieces[p].component);
        rest[pieces[p].component] = 0;
        gone.emplace_back(pieces[p].box.min().head<2>().array().floor(),
                          pieces[p].box.max().head<2>().array().ceil());
    }
    return torn;
}

}  // namespace isotrack
