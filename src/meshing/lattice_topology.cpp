#include "isotrack/meshing/lattice_topology.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <tuple>

#include "surface/ambiguous_faces.h"
#include "surface/thread_probes.h"

namespace isotrack {
namespace {

using Node = std::array<int, 3>;

/// Triangles joined through common vertices. Components are numbered in the order of their first triangle.
std::vector<int> component_of_triangles(std::size_t vertices, const std::vector<Triangle>& triangles,
                                        int& count) {
    std::vector<int> parent(vertices);
    std::iota(parent.begin(), parent.end(), 0);
    const auto find = [&](int v) {
        while (parent[v] != v) v = parent[v] = parent[parent[v]];
        return v;
    };
    for (const Triangle& t : triangles)
        for (const int v : {t[1], t[2]}) parent[find(v)] = find(t[0]);
    std::vector<int> number(vertices, -1), result;
    count = 0;
    for (const Triangle& t : triangles) {
        int& n = number[find(t[0])];
        if (n < 0) n = count++;
        result.push_back(n);
    }
    return result;
}

/// The lines run a hair beside the nodes, so that they miss the vertices and edges of meshes that are aligned
/// with the lattice.
constexpr double kBeside[2] = {1.3e-7, 2.9e-7};

constexpr double kOnNode = 1e-6;  // lattice units

/// Twice the signed area of pqr in the plane; of a shared edge pq both triangles get the same bits but for
/// the sign.
double area2(const Vec3& p, const Vec3& q, double x, double y) {
    const bool swap = std::tie(p.x(), p.y(), p.z()) > std::tie(q.x(), q.y(), q.z());
    const Vec3 &a = swap ? q : p, &b = swap ? p : q;
    const double area = (b.x() - a.x()) * (y - a.y()) - (b.y() - a.y()) * (x - a.x());
    return swap ? -area : area;
}

std::vector<LineHit> hits_of(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                             const std::vector<int>& component) {
    constexpr std::size_t kBlock = 512;
    std::vector<std::vector<LineHit>> blocks((triangles.size() + kBlock - 1) / kBlock);
    const auto add_hits = [&](std::size_t t, std::vector<LineHit>& hits) {
        const Vec3 &a = points[triangles[t][0]], &b = points[triangles[t][1]], &c = points[triangles[t][2]];
        const Vec3 low = a.cwiseMin(b).cwiseMin(c), high = a.cwiseMax(b).cwiseMax(c);
        for (int x = static_cast<int>(std::ceil(low.x() - kBeside[0])); x + kBeside[0] <= high.x(); ++x)
            for (int y = static_cast<int>(std::ceil(low.y() - kBeside[1])); y + kBeside[1] <= high.y(); ++y) {
                const double px = x + kBeside[0], py = y + kBeside[1];
                const double wa = area2(b, c, px, py), wb = area2(c, a, px, py), wc = area2(a, b, px, py);
                if (!((wa > 0.0 && wb > 0.0 && wc > 0.0) || (wa < 0.0 && wb < 0.0 && wc < 0.0))) continue;
                hits.push_back({x, y, component[t], (wa * a.z() + wb * b.z() + wc * c.z()) / (wa + wb + wc)});
            }
    };
    tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t block) {
        const std::size_t end = std::min(triangles.size(), (block + 1) * kBlock);
        for (std::size_t t = block * kBlock; t < end; ++t) add_hits(t, blocks[block]);
    });
    std::vector<LineHit> hits;
    for (const auto& block : blocks) hits.insert(hits.end(), block.begin(), block.end());
    return hits;
}

/// Sorts by x, then by `less`. Returns where each x begins, from the least on, and the end.
template <typename Less>
std::vector<std::size_t> sort_by_x(std::vector<LineHit>& hits, const Less& less) {
    if (hits.empty()) return {};
    const auto [low, high] = std::minmax_element(
        hits.begin(), hits.end(), [](const LineHit& a, const LineHit& b) { return a.x < b.x; });
    const int from = low->x;
    std::vector<std::size_t> first(static_cast<std::size_t>(high->x - from) + 2, 0);
    for (const LineHit& h : hits) ++first[h.x - from + 1];
    for (std::size_t i = 1; i < first.size(); ++i) first[i] += first[i - 1];
    std::vector<std::size_t> end(first.begin(), first.end() - 1);
    std::vector<LineHit> sorted(hits.size());
    for (const LineHit& h : hits) sorted[end[h.x - from]++] = h;
    hits.swap(sorted);
    tbb::parallel_for(std::size_t{0}, first.size() - 1, [&](std::size_t i) {
        std::sort(hits.begin() + static_cast<std::ptrdiff_t>(first[i]),
                  hits.begin() + static_cast<std::ptrdiff_t>(first[i + 1]), less);
    });
    return first;
}

bool is_before(const LineHit& a, const LineHit& b) {
    return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
}

/// Sets of a node's 26 neighbours as bits; bit 9 (x + 1) + 3 (y + 1) + z + 1, the node itself is bit 13.
int bit_of(int x, int y, int z) {
    return 9 * (x + 1) + 3 * (y + 1) + z + 1;
}

struct Neighbourhoods {
    std::uint32_t touching[27] = {};  // neighbours that share a corner, an edge or a face
    std::uint32_t beside[27] = {};    // neighbours that share a face
    std::uint32_t all = 0, at_face = 0, no_corner = 0;
    Neighbourhoods() {
        const auto each = [](const auto& body) {
            for (int x = -1; x <= 1; ++x)
                for (int y = -1; y <= 1; ++y)
                    for (int z = -1; z <= 1; ++z) body(x, y, z);
        };
        each([&](int x, int y, int z) {
            const int i = bit_of(x, y, z), far = std::abs(x) + std::abs(y) + std::abs(z);
            if (far == 0) return;
            all |= 1u << i;
            if (far == 1) at_face |= 1u << i;
            if (far <= 2) no_corner |= 1u << i;
            each([&](int u, int v, int w) {
                const int dx = std::abs(u - x), dy = std::abs(v - y), dz = std::abs(w - z);
                if ((u == 0 && v == 0 && w == 0) || std::max({dx, dy, dz}) != 1) return;
                touching[i] |= 1u << bit_of(u, v, w);
                if (dx + dy + dz == 1) beside[i] |= 1u << bit_of(u, v, w);
            });
        });
    }
};

/// The bits of `set` that are connected with its bits in `seed`.
std::uint32_t spread(std::uint32_t seed, std::uint32_t set, const std::uint32_t* near) {
    std::uint32_t found = seed & set, rim = found;
    while (rim != 0) {
        std::uint32_t next = 0;
        for (; rim != 0; rim &= rim - 1) next |= near[__builtin_ctz(rim)];
        rim = next & set & ~found;
        found |= rim;
    }
    return found;
}

/// Whether a node may change sides without changing the topology of either [Bertrand, Malandain 1994]: the
/// inside around it is one 26-connected set, and the outside that reaches it through a face is one
/// 6-connected set within its 18 nearest neighbours. `inside`: the neighbours that are inside.
bool is_simple(std::uint32_t inside) {
    static const Neighbourhoods around;
    inside &= around.all;
    const std::uint32_t outside = ~inside & around.no_corner, reached = outside & around.at_face;
    if (inside == 0 || reached == 0) return false;
    const auto lowest = [](std::uint32_t set) { return set & (~set + 1u); };
    if (spread(lowest(inside), inside, around.touching) != inside) return false;
    return (reached & ~spread(lowest(reached), outside, around.beside)) == 0;
}

/// Whether volumeToMesh joins an inside node with the one at `to`, inside as well: through a face always;
/// across the diagonal of a face whose other two nodes are outside sometimes; never across a cell. `inside`:
/// of the nodes around the first, as above. Nodes that are joined through a third one are so anyway.
bool is_joined(std::uint32_t inside, const Node& to) {
    const auto axes = 3 - std::count(to.begin(), to.end(), 0);
    if (axes != 2) return axes == 1;
    const auto off = static_cast<int>(std::find(to.begin(), to.end(), 0) - to.begin());  // across the face
    return joins_diagonal([&](int side, int first, int second) {
        Node n;
        n[off] = 2 * side - 1;
        n[(off + 1) % 3] = first * to[(off + 1) % 3];
        n[(off + 2) % 3] = second * to[(off + 2) % 3];
        return (inside >> bit_of(n[0], n[1], n[2]) & 1u) != 0;
    });
}

/// Whether a segment from p to q crosses a triangle, by the signs of volumes: an edge that the segment
/// touches counts for one of its triangles.
bool crosses(const Vec3& p, const Vec3& q, const Vec3& a, const Vec3& b, const Vec3& c) {
    const Vec3 d = q - p, normal = (b - a).cross(c - a);
    if ((normal.dot(p - a) < 0.0) == (normal.dot(q - a) < 0.0)) return false;
    const bool ab = d.dot((a - p).cross(b - p)) < 0.0, bc = d.dot((b - p).cross(c - p)) < 0.0,
               ca = d.dot((c - p).cross(a - p)) < 0.0;
    return ab == bc && bc == ca;
}

double low_x(const Surface::Diagonal& d) {
    return std::min(d.from.x(), d.to.x());
}

/// Those of the diagonals, ascending by their low x, that the mesh crosses twice or more often.
std::vector<Surface::Diagonal> parted_diagonals(const std::vector<Vec3>& points,
                                                const std::vector<Triangle>& triangles,
                                                const std::vector<Surface::Diagonal>& diagonals) {
    std::vector<Surface::Diagonal> result;
    if (diagonals.empty()) return result;
    double longest = 0.0;
    for (const auto& d : diagonals) longest = std::max(longest, (d.to - d.from).norm());
    std::vector<int> crossed(diagonals.size(), 0);
    for (const Triangle& t : triangles) {
        const Vec3 &a = points[t[0]], &b = points[t[1]], &c = points[t[2]];
        const Vec3 low = a.cwiseMin(b).cwiseMin(c), high = a.cwiseMax(b).cwiseMax(c);
        auto d = std::lower_bound(diagonals.begin(), diagonals.end(), low.x() - longest,
                                  [](const auto& diagonal, double x) { return low_x(diagonal) < x; });
        for (; d != diagonals.end() && low_x(*d) <= high.x(); ++d)
            if ((d->from.cwiseMin(d->to).array() <= high.array()).all() &&
                (d->from.cwiseMax(d->to).array() >= low.array()).all())
                crossed[d - diagonals.begin()] += crosses(d->from, d->to, a, b, c);
    }
    for (std::size_t i = 0; i < diagonals.size(); ++i)
        if (crossed[i] > 0 && crossed[i] % 2 == 0) result.push_back(diagonals[i]);
    return result;
}

}  // namespace

LatticeSides::LatticeSides(const Surface& surface, const std::vector<Surface::Crossing>& crossings)
    : surface_(surface), diagonals_(surface.diagonals()) {
    std::stable_sort(diagonals_.begin(), diagonals_.end(),
                     [](const auto& a, const auto& b) { return low_x(a) < low_x(b); });
    const Eigen::Affine3d lattice = surface.lattice(), to_lattice = lattice.inverse();
    const auto probe = surface.probe();
    for (const auto& c : crossings) {
        const Vec3 way = to_lattice.linear() * c.outward.cast<double>(), p = to_lattice * c.point;
        if (std::abs(way.z()) < 0.5 * way.norm()) continue;
        const Node nearest = {static_cast<int>(std::lround(p.x())), static_cast<int>(std::lround(p.y())),
                              static_cast<int>(std::lround(p.z()))};
        // The crossing counts in the middle between its two nodes; on a node rounding decides which those
        // are.
        const double beyond = p.z() - nearest[2];
        const auto is_inside = [&] {
            return probe->value(lattice * Vec3(nearest[0], nearest[1], nearest[2])) < 0.0;
        };
        const bool up = std::abs(beyond) > kOnNode ? beyond > 0.0 : is_inside() == (way.z() > 0.0);
        hits_.push_back({nearest[0], nearest[1], 0, nearest[2] + (up ? 0.5 : -0.5)});
    }
    first_ = sort_by_x(hits_, is_before);
}

std::pair<const LineHit*, const LineHit*> LatticeSides::line(int x, int y) const {
    const LineHit* none = nullptr;
    if (hits_.empty() || x < hits_.front().x || x > hits_.back().x) return {none, none};
    const std::size_t at = static_cast<std::size_t>(x - hits_.front().x);
    const LineHit *begin = hits_.data() + first_[at], *end = hits_.data() + first_[at + 1];
    begin = std::partition_point(begin, end, [&](const LineHit& h) { return h.y < y; });
    return {begin, std::find_if(begin, end, [&](const LineHit& h) { return h.y != y; })};
}

LatticeTopology lattice_topology(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                                 const LatticeSides& sides) {
    const Surface& surface = sides.surface();
    const Eigen::Affine3d lattice = sides.surface().lattice(), to_lattice = lattice.inverse();
    std::vector<Vec3> in_lattice;
    in_lattice.reserve(points.size());
    for (const Vec3& p : points) in_lattice.push_back(to_lattice * p);
    int components = 0;
    const std::vector<int> component = component_of_triangles(points.size(), triangles, components);
    std::vector<LineHit> hits = hits_of(in_lattice, triangles, component);
    LatticeTopology result;

    // Components with a node between two hits of their own.
    sort_by_x(hits, [](const LineHit& a, const LineHit& b) {
        return std::tie(a.component, a.y, a.z) < std::tie(b.component, b.y, b.z);
    });
    std::vector<char> holds_node(components, 0);
    for (std::size_t h = 0; h + 1 < hits.size();) {
        const LineHit &a = hits[h], &b = hits[h + 1];
        if (std::tie(a.component, a.x, a.y) != std::tie(b.component, b.x, b.y)) {
            ++h;  // an odd hit: the line grazes an edge
            continue;
        }
        if (std::floor(b.z) >= a.z) holds_node[a.component] = 1;
        h += 2;
    }
    result.speck.resize(triangles.size());
    for (std::size_t t = 0; t < triangles.size(); ++t) result.speck[t] = !holds_node[component[t]];

    // Mesh and surface cross each line at places of their own; between two of them the nodes are on the wrong
    // side.
    hits.erase(
        std::remove_if(hits.begin(), hits.end(), [&](const LineHit& h) { return !holds_node[h.component]; }),
        hits.end());
    sort_by_x(hits, is_before);
    std::vector<LineHit> both(hits.size() + sides.hits().size());
    std::merge(hits.begin(), hits.end(), sides.hits().begin(), sides.hits().end(), both.begin(), is_before);
    std::vector<Node> wrong;  // ascending
    for (std::size_t h = 0; h + 1 < both.size();) {
        const LineHit &a = both[h], &b = both[h + 1];
        if (std::tie(a.x, a.y) != std::tie(b.x, b.y)) {
            ++h;
            continue;
        }
        for (int z = static_cast<int>(std::ceil(a.z)); z <= b.z; ++z)
            if (wrong.empty() || wrong.back() < Node{a.x, a.y, z}) wrong.push_back({a.x, a.y, z});
        h += 2;
    }

    // The sides of the nodes around each as the mesh has them, and which of those are wrong.
    struct Around {
        std::uint32_t inside = 0;
        int wrong[27];
    };
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
    ThreadProbes probes(surface);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, wrong.size(), 64), [&](const auto& range) {
        Surface::Probe& own_probe = probes.local();
        // The lines around a node, and the first of the wrong nodes that are not below: both only go up.
        struct Line {
            const LineHit *begin, *end;
            bool known;  // it comes out where it went in
            std::vector<Node>::const_iterator at;
        };
        Line lines[3][3];
        for (std::size_t w = range.begin(); w < range.end(); ++w) {
            const bool same_line =
                w > range.begin() && wrong[w][0] == wrong[w - 1][0] && wrong[w][1] == wrong[w - 1][1];
            for (int x = -1; x <= 1; ++x)
                for (int y = -1; y <= 1; ++y) {
                    const Node low = {wrong[w][0] + x, wrong[w][1] + y, wrong[w][2] - 1};
                    Line& line = lines[x + 1][y + 1];
                    if (!same_line) {
                        std::tie(line.begin, line.end) = sides.line(low[0], low[1]);
                        line.known = (line.end - line.begin) % 2 == 0;
                        line.at = from(w > range.begin() ? line.at : wrong.cbegin(), low);
                    }
                    while (line.at != wrong.end() && *line.at < low) ++line.at;
                    auto at = line.at;
                    for (int z = -1; z <= 1; ++z) {
                        const Node m = {low[0], low[1], wrong[w][2] + z};
                        const bool is_wrong = at != wrong.end() && !(m < *at);
                        const auto below =
                            std::count_if(line.begin, line.end, [&](const LineHit& h) { return h.z < m[2]; });
                        const bool inside = line.known
                                                ? below % 2 == 1
                                                : own_probe.value(lattice * Vec3(m[0], m[1], m[2])) < 0.0;
                        if (inside != is_wrong) around[w].inside |= 1u << bit_of(x, y, z);
                        around[w].wrong[bit_of(x, y, z)] =
                            is_wrong ? static_cast<int>(at - wrong.begin()) : -1;
                        at += is_wrong;
                    }
                }
        }
    });
    // Inside nodes that hang together, none of them inside the mesh, are a component that is lost even where
    // a corner joins them to others.
    std::vector<std::uint32_t> truth(wrong.size());
    std::vector<char> lost(wrong.size());
    for (std::size_t w = 0; w < wrong.size(); ++w) {
        truth[w] = around[w].inside;
        for (int bit = 0; bit < 27; ++bit)
            if (around[w].wrong[bit] >= 0) truth[w] ^= 1u << bit;
        lost[w] = (truth[w] >> bit_of(0, 0, 0) & 1u) != 0;
    }
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
    for (bool any = true; any;) {
        any = false;
        for (std::size_t w = 0; w < wrong.size(); ++w) {
            if (!lost[w] || !is_held(w)) continue;
            lost[w] = 0;
            any = true;
        }
    }
    std::vector<char> put_right(wrong.size(), 0);
    for (bool any = true; any;) {
        any = false;
        for (std::size_t w = 0; w < wrong.size(); ++w) {
            if (put_right[w] || lost[w] || !is_simple(around[w].inside)) continue;
            put_right[w] = 1;
            any = true;
            for (int bit = 0; bit < 27; ++bit)  // bit 26 - b is the way back
                if (const int other = around[w].wrong[bit]; other >= 0)
                    around[other].inside ^= 1u << (26 - bit);
        }
    }
    for (std::size_t w = 0; w < wrong.size(); ++w)
        if (!put_right[w]) result.faults.push_back(lattice * Vec3(wrong[w][0], wrong[w][1], wrong[w][2]));
    result.parted = parted_diagonals(points, triangles, sides.diagonals());
    return result;
}

}  // namespace isotrack
