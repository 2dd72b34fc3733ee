// The 26 neighbours of a lattice node as sets of bits.
#pragma once

#include <cstdint>

#include "meshing/contested_nodes.h"

namespace isotrack {

/// Bit 9 (x + 1) + 3 (y + 1) + z + 1 stands for the neighbour that many steps away; the node itself is
/// bit 13.
inline int bit_of(int x, int y, int z) {
    return 9 * (x + 1) + 3 * (y + 1) + z + 1;
}

/// Whether a node may change sides without changing the topology of either [Bertrand, Malandain 1994]: the
/// inside around it is one 26-connected set, and the outside that reaches it through a face is one
/// 6-connected set within its 18 nearest neighbours. `inside`: the neighbours that are inside.
bool is_simple(std::uint32_t inside);

/// Whether volumeToMesh joins an inside node with the one at `to`, inside as well: through a face always;
/// across the diagonal of a face whose other two nodes are outside sometimes; never across a cell. `inside`:
/// of the nodes around the first, as above. Nodes that are joined through a third one are so anyway.
bool is_joined(std::uint32_t inside, const Node& to);

}  // namespace isotrack
