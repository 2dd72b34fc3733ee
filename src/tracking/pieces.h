// A surface in pieces that move rigidly.
#pragma once

#include <vector>

#include "isotrack/sampling/adjacency.h"
#include "isotrack/types.h"

namespace isotrack {

/// Particles next to each other, and how they move together: x -> turn (x - middle) + middle + shift.
struct Piece {
    std::vector<int> particles;
    std::vector<int> beside;  // pieces, ascending
    Vec3 middle = Vec3::Zero(), shift = Vec3::Zero();
    Mat3 turn = Mat3::Identity();
    double size2 = 0.0;  // mean square of how far its particles are from the middle

    Vec3 moved(const Vec3& x) const { return turn * (x - middle) + middle + shift; }
};

/// Of about 50 particles each that are next to each other along `ring`, larger ones where there would be more
/// than 160; of what hangs together none is smaller than a quarter of that unless it is all. Each particle is
/// in one. They have not moved.
std::vector<Piece> make_pieces(const Adjacency& ring, const std::vector<Vec3>& at);

/// Gives it the rigid motion that takes its particles nearest to where they come to [Kabsch 1976]; the turn
/// of a point or a line, which nobody knows, stays as it was.
void move_as(const std::vector<Vec3>& from, const std::vector<Vec3>& to, Piece& piece);

/// Where the pieces take the particles, each by its own and those beside it. Uses TBB inside.
std::vector<Vec3> blended(const std::vector<Piece>& pieces, const std::vector<Vec3>& from);

}  // namespace isotrack
