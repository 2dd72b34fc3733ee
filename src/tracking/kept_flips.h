// The flips in one frame's mesh, carried over to the meshes that follow it.
#pragma once

#include <array>
#include <vector>

#include "isotrack/meshing/manifold.h"

namespace isotrack {

/// Flips that share no triangle, so that each can be taken back alone.
class KeptFlips {
public:
    KeptFlips() = default;
    /// `flips`: the triangles that each took from `before` to `carved`. All their vertices must stand on a
    /// particle alone.
    KeptFlips(const std::vector<std::array<int, 2>>& flips, const std::vector<Triangle>& before,
              const CarvedSurface& carved);

    /// Puts them into the next mesh, which has none. `now`: of each triangle of the last mesh, which one it
    /// is there, -1 if none; `vertex`: of each particle, negative if it has not just one there. A flip that
    /// misses one of these is forgotten; what is left of its triangles gets flags in `around`, per vertex.
    void put_into(CarvedSurface& carved, const std::vector<int>& now, const std::vector<int>& vertex,
                  std::vector<char>& around);
    /// Takes back, and forgets, those with flagged vertices, and flags all of theirs. Returns whether there
    /// were any.
    bool undo_at(std::vector<char>& flagged, const std::vector<int>& vertex, CarvedSurface& carved);

private:
    struct Kept {
        std::array<int, 2> triangle;
        std::array<Triangle, 2> before, after;  // of particles
    };
    std::vector<Kept> flips_;
};

}  // namespace isotrack
