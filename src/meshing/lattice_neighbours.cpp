#include "meshing/lattice_neighbours.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdlib>

#include "surface/ambiguous_faces.h"

namespace isotrack {
namespace {

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

bool find_is_simple(std::uint32_t inside) {
    static const Neighbourhoods around;
    inside &= around.all;
    const std::uint32_t outside = ~inside & around.no_corner, reached = outside & around.at_face;
    if (inside == 0 || reached == 0) return false;
    const auto lowest = [](std::uint32_t set) { return set & (~set + 1u); };
    if (spread(lowest(inside), inside, around.touching) != inside) return false;
    return (reached & ~spread(lowest(reached), outside, around.beside)) == 0;
}

}  // namespace

bool is_simple(std::uint32_t inside) {
    // Most nodes lie at smooth surfaces and have one of few neighbourhoods: what was found lately is kept,
    // each at one place, with the answer in the lowest bit.
    constexpr std::size_t kPlaces = 1 << 12;
    thread_local std::array<std::uint32_t, kPlaces> found{};
    const std::uint32_t others = inside & ~(1u << bit_of(0, 0, 0)), known = others << 1;
    if (others == 0) return false;
    std::uint32_t& place = found[(others * 2654435761u) >> 20];
    if ((place & ~1u) != known) place = known | (find_is_simple(others) ? 1u : 0u);
    return (place & 1u) != 0;
}

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

}  // namespace isotrack
