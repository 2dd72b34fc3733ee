#include "isotrack/meshing/lattice_topology.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <tuple>

#include "disjoint_sets.h"
#include "meshing/contested_nodes.h"
#include "meshing/lattice_neighbours.h"
#include "parallel_for_each.h"
#include "surface/thread_probes.h"

namespace isotrack {
namespace {

/// Triangles joined through common vertices. Components are numbered in the order of their first triangle.
std::vector<int> component_of_triangles(std::size_t vertices, const std::vector<Triangle>& triangles,
                                        int& count) {
    DisjointSets sets(vertices);
    for (const Triangle& t : triangles)
        for (const int v : {t[1], t[2]}) sets.join(t[0], v);
    std::vector<int> number(vertices, -1), result;
    count = 0;
    for (const Triangle& t : triangles) {
        int& n = number[sets.least(t[0])];
        if (n < 0) n = count++;
        result.push_back(n);
    }
    return result;
}

/// Whether a segment from p to q crosses a triangle, by the signs of volumes: an edge that the segment
/// touches is crossed for one of its triangles.
bool crosses(const Vec3& p, const Vec3& q, const Vec3& a, const Vec3& b, const Vec3& c) {
    const Vec3 d = q - p, normal = (b - a).cross(c - a);
    if ((normal.dot(p - a) < 0.0) == (normal.dot(q - a) < 0.0)) return false;
    const bool ab = d.dot((a - p).cross(b - p)) < 0.0, bc = d.dot((b - p).cross(c - p)) < 0.0,
               ca = d.dot((c - p).cross(a - p)) < 0.0;
    return ab == bc && bc == ca;
}

/// Those of the diagonals, ascending by their low x, that the mesh crosses twice or more often.
std::vector<Surface::Diagonal> parted_diagonals(const std::vector<Vec3>& points,
                                                const std::vector<Triangle>& triangles,
                                                const std::vector<Surface::Diagonal>& diagonals) {
    std::vector<Surface::Diagonal> result;
    if (diagonals.empty()) return result;
    double longest = 0.0;
    for (const auto& d : diagonals) longest = std::max(longest, (d.to - d.from).norm());
    std::vector<std::atomic<int>> crossed(diagonals.size());  // counted by several threads
    constexpr std::size_t kGrain = 1024;
    parallel_for_each(triangles.size(), kGrain, [&](std::size_t n) {
        const Triangle& t = triangles[n];
        const Vec3 &a = points[t[0]], &b = points[t[1]], &c = points[t[2]];
        const Vec3 low = a.cwiseMin(b).cwiseMin(c), high = a.cwiseMax(b).cwiseMax(c);
        auto d = std::lower_bound(
            diagonals.begin(), diagonals.end(), low.x() - longest,
            [](const auto& diagonal, double x) { return std::min(diagonal.from.x(), diagonal.to.x()) < x; });
        for (; d != diagonals.end() && d->from.cwiseMin(d->to).x() <= high.x(); ++d)
            if ((d->from.cwiseMin(d->to).array() <= high.array()).all() &&
                (d->from.cwiseMax(d->to).array() >= low.array()).all() && crosses(d->from, d->to, a, b, c))
                crossed[d - diagonals.begin()].fetch_add(1, std::memory_order_relaxed);
    });
    for (std::size_t i = 0; i < diagonals.size(); ++i)
        if (crossed[i] > 0 && crossed[i] % 2 == 0) result.push_back(diagonals[i]);
    return result;
}

/// The nodes around one that is wrong.
struct Around {
    std::uint32_t inside = 0;  // as the mesh has them
    int wrong[27];             // their numbers among the wrong ones, or -1
};

std::vector<Around> look_around(const std::vector<Node>& wrong, const LatticeSides& sides) {
    std::vector<Around> around(wrong.size());
    // The first wrong node from `node` on, which is not before `at` and seldom far.
    const auto from = [&](std::vector<Node>::const_iterator at, const Node& node) {
        std::ptrdiff_t step = 1;
        while (wrong.end() - at > step && at[step] < node) {
            at += step;
            step *= 2;
        }
        return std::lower_bound(at, wrong.end() - at > step ? at + step : wrong.end(), node);
    };
    ThreadProbes probes(sides.surface());
    const Eigen::Affine3d lattice = sides.surface().lattice();
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, wrong.size(), 64), [&](const auto& range) {
        Surface::Probe& own_probe = probes.local();
        // The lines around a node, and the first of the wrong nodes that are not below: both only go up.
        struct Line {
            Uprights::Range crossed;
            bool known;  // it comes out where it went in
            std::vector<Node>::const_iterator at;
        };
        Line lines[3][3];
        for (std::size_t w = range.begin(); w < range.end(); ++w) {
            const bool same_line =
                w > range.begin() && wrong[w][0] == wrong[w - 1][0] && wrong[w][1] == wrong[w - 1][1];
            const bool is_next = same_line && wrong[w][2] == wrong[w - 1][2] + 1;
            for (int x = -1; x <= 1; ++x)
                for (int y = -1; y <= 1; ++y) {
                    const Node low = {wrong[w][0] + x, wrong[w][1] + y, wrong[w][2] - 1};
                    Line& line = lines[x + 1][y + 1];
                    if (!same_line) {
                        line.crossed = sides.uprights().line(low[0], low[1]);
                        line.known = (line.crossed.second - line.crossed.first) % 2 == 0;
                        line.at = from(w > range.begin() ? line.at : wrong.cbegin(), low);
                    }
                    while (line.at != wrong.end() && *line.at < low) ++line.at;
                    auto at = line.at;
                    for (int z = -1; z <= 1; ++z) {
                        const int bit = bit_of(x, y, z);
                        if (is_next && z < 1) {  // it was around the one before
                            around[w].inside |= around[w - 1].inside >> 1 & 1u << bit;
                            around[w].wrong[bit] = around[w - 1].wrong[bit + 1];
                            at += around[w].wrong[bit] >= 0;
                            continue;
                        }
                        const Node m = {low[0], low[1], wrong[w][2] + z};
                        const bool is_wrong = at != wrong.end() && !(m < *at);
                        const auto below = std::count_if(line.crossed.first, line.crossed.second,
                                                         [&](const Uprights::Node& u) { return u.z < m[2]; });
                        const bool inside = line.known
                                                ? below % 2 == 1
                                                : own_probe.value(lattice * Vec3(m[0], m[1], m[2])) < 0.0;
                        if (inside != is_wrong) around[w].inside |= 1u << bit;
                        around[w].wrong[bit] = is_wrong ? static_cast<int>(at - wrong.begin()) : -1;
                        at += is_wrong;
                    }
                }
        }
    });
    return around;
}

/// The flagged nodes, put together where volumeToMesh joins them. World positions. `truth`: the nodes around
/// each that are inside.
std::vector<std::vector<Vec3>> lost_components(const std::vector<Node>& wrong, const std::vector<char>& lost,
                                               const std::vector<Around>& around,
                                               const std::vector<std::uint32_t>& truth,
                                               const Eigen::Affine3d& lattice) {
    std::vector<std::vector<Vec3>> result;
    std::vector<char> seen(wrong.size(), 0);
    for (std::size_t first = 0; first < wrong.size(); ++first) {
        if (!lost[first] || seen[first]) continue;
        result.emplace_back();
        std::vector<std::size_t> stack{first};
        seen[first] = 1;
        while (!stack.empty()) {
            const std::size_t w = stack.back();
            stack.pop_back();
            result.back().push_back(lattice * Vec3(wrong[w][0], wrong[w][1], wrong[w][2]));
            for (int bit = 0; bit < 27; ++bit) {
                const int other = around[w].wrong[bit];
                if (other < 0 || !lost[other] || seen[other] ||
                    !is_joined(truth[w], {bit / 9 - 1, bit / 3 % 3 - 1, bit % 3 - 1}))
                    continue;
                seen[other] = 1;
                stack.push_back(static_cast<std::size_t>(other));
            }
        }
    }
    return result;
}

/// Visits 0 to `count` - 1 in order, then those that visits ask to look at again, in order, until none is
/// left.
template <typename Visit>
void visit_until_rest(std::size_t count, const Visit& visit) {
    std::vector<std::size_t> again;
    std::vector<char> listed(count, 0);
    const auto look_again = [&](std::size_t other) {
        if (!listed[other]) again.push_back(other);
        listed[other] = 1;
    };
    for (std::size_t w = 0; w < count; ++w) visit(w, look_again);
    while (!again.empty()) {
        std::vector<std::size_t> now;
        now.swap(again);
        std::sort(now.begin(), now.end());
        for (const std::size_t w : now) listed[w] = 0;
        for (const std::size_t w : now) visit(w, look_again);
    }
}

}  // namespace

LatticeTopology lattice_topology(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                                 const LatticeSides& sides) {
    const Eigen::Affine3d lattice = sides.surface().lattice(), to_lattice = lattice.inverse();
    std::vector<Vec3> in_lattice;
    in_lattice.reserve(points.size());
    for (const Vec3& p : points) in_lattice.push_back(to_lattice * p);
    int components = 0;
    const std::vector<int> component = component_of_triangles(points.size(), triangles, components);
    const auto [wrong, is_part] = contested_nodes(in_lattice, triangles, component, components, sides);
    LatticeTopology result;
    for (const int c : component) result.speck.push_back(!is_part[c]);

    std::vector<Around> around = look_around(wrong, sides);
    // Inside nodes that hang together, none of them inside the mesh, are a component that is lost even where
    // a corner joins them to others.
    std::vector<std::uint32_t> truth(wrong.size());
    std::vector<char> lost(wrong.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, wrong.size(), 1024), [&](const auto& range) {
        for (std::size_t w = range.begin(); w < range.end(); ++w) {
            truth[w] = around[w].inside;
            for (int bit = 0; bit < 27; ++bit)
                if (around[w].wrong[bit] >= 0) truth[w] ^= 1u << bit;
            lost[w] = (truth[w] >> bit_of(0, 0, 0) & 1u) != 0;
        }
    });
    const auto is_held = [&](std::size_t w) {
        for (int x = -1; x <= 1; ++x)
            for (int y = -1; y <= 1; ++y)
                for (int z = -1; z <= 1; ++z) {
                    const int bit = bit_of(x, y, z), other = around[w].wrong[bit];
                    if ((truth[w] >> bit & 1u) != 0 && (other < 0 || !lost[other]) &&
                        is_joined(truth[w], {x, y, z}))
                        return true;
                }
        return false;
    };
    const auto for_each_wrong_around = [&](std::size_t w, const auto& visit) {
        for (int bit = 0; bit < 27; ++bit)
            if (const int other = around[w].wrong[bit]; other >= 0)
                visit(static_cast<std::size_t>(other), bit);
    };
    // Most are held at once; in what order does not matter.
    std::vector<char> held(wrong.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, wrong.size(), 1024), [&](const auto& range) {
        for (std::size_t w = range.begin(); w < range.end(); ++w) held[w] = lost[w] && is_held(w);
    });
    for (std::size_t w = 0; w < wrong.size(); ++w) lost[w] = lost[w] && !held[w];
    visit_until_rest(wrong.size(), [&](std::size_t w, const auto& look_again) {
        if (!lost[w] || !is_held(w)) return;
        lost[w] = 0;
        for_each_wrong_around(w, [&](std::size_t other, int) { look_again(other); });
    });
    result.lost = lost_components(wrong, lost, around, truth, lattice);
    std::vector<char> put_right(wrong.size(), 0);
    visit_until_rest(wrong.size(), [&](std::size_t w, const auto& look_again) {
        if (put_right[w] || lost[w] || !is_simple(around[w].inside)) return;
        put_right[w] = 1;
        for_each_wrong_around(w, [&](std::size_t other, int bit) {
            around[other].inside ^= 1u << (26 - bit);  // the way back
            look_again(other);
        });
    });
    for (std::size_t w = 0; w < wrong.size(); ++w)
        if (!put_right[w]) result.faults.push_back(lattice * Vec3(wrong[w][0], wrong[w][1], wrong[w][2]));
    result.parted = parted_diagonals(points, triangles, sides.diagonals());
    return result;
}

}  // namespace isotrack
