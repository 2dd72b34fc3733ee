// Where a surface passes through the cells of its lattice.
#pragma once

#include <cstdint>
#include <vector>

#include "isotrack/surface/crossing_grid.h"
#include "surface/packed_crossings.h"

namespace isotrack {

class CellPoints {
public:
    /// `crossings`: of `surface`, none that stands for others. Both must outlive it. `diagonals`: all of the
    /// surface.
    CellPoints(const Surface& surface, const CrossingGrid& crossings,
               const std::vector<Surface::Diagonal>& diagonals);

    /// In the cells around the edges that some crossings are on, and in all with an ambiguous face: for each
    /// part of the surface in a cell the mean of its crossings, where volumeToMesh has its vertices. Outward
    /// is the middle between the directions they go; one of them where these cancel out. Cells given before
    /// are left out. In an order that does not depend on the number of threads.
    PackedCrossings around(const std::vector<int>& some);

private:
    /// Two corners of a cell that hang together across a diagonal of one of its faces.
    struct Join {
        std::uint64_t cell;  // packed
        int corners[2];
    };

    const Surface& surface_;
    const CrossingGrid& crossings_;
    const Eigen::Affine3d lattice_;
    std::vector<Join> joins_;           // by cell
    std::vector<std::uint64_t> given_;  // packed cells, ascending
};

}  // namespace isotrack
