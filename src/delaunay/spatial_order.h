// The order in which points are best inserted.
#pragma once

#include <vector>

#include "isotrack/types.h"

namespace isotrack {

constexpr double kRoundShare = 0.125;

/// Sorts numbers of points so that one is near the one before, but for a random `kRoundShare` of them, which
/// come first and are sorted so in turn (Amenta, Choi and Rote 2003). Depends on the points and `order`
/// alone; uses TBB inside.
void sort_spatially(const std::vector<Vec3>& points, std::vector<int>& order);

/// The same in one round: along Hilbert's curve.
void sort_along_curve(const std::vector<Vec3>& points, std::vector<int>& order);

}  // namespace isotrack
