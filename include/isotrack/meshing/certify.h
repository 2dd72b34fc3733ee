// Holding a mesh against the surface, both ways.
#pragma once

#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "isotrack/delaunay/tetrahedralisation.h"
#include "isotrack/surface/crossing_grid.h"
#include "isotrack/types.h"

namespace isotrack {

/// How far a triangle is from the surface. World units.
struct TriangleError {
    double largest = 0.0;  ///< Of |farther value| at the points looked at.
    double mean_square = 0.0;
    Vec3 where = Vec3::Zero();  ///< The point with the largest.
    double turned_deg = 0.0;    ///< `turned_deg`, where it is asked for.
};

/// The error of triangle abc at the points of a regular barycentric lattice with `steps` intervals per edge
/// (>= 1): (steps+1)(steps+2)/2 points. Where it is above `refine_above` on a side of the surface it is also
/// looked for between them. With 3 to 6 steps, if the values are those of a quadratic function to within 5 %
/// of the largest on that side: at that function's peak. Where the value is another there, or at least 1.4
/// `refine_above`, and with other steps: uphill, to within two percent. The mean is that of the points.
TriangleError triangle_error(const Vec3& a, const Vec3& b, const Vec3& c, Surface::Probe& probe, int steps,
                             double refine_above = std::numeric_limits<double>::infinity());

/// A triangle whose normal is farther from those of the surface is turned; and the cosine of that angle.
constexpr double kMostTurnedDeg = 60.0, kFacing = 0.5;
/// The cosine between the normal of triangle abc and O2 at its centroid; where that is below kFacing, the
/// largest of it and those at the corners: a triangle across a crease may face as one of the sides does.
double facing(const Vec3& a, const Vec3& b, const Vec3& c, Surface::Probe& probe);
/// That as an angle in degrees; 0 where it says nothing: on triangles less than half a `detail` high, and
/// where the gradient at the centroid is shorter than 0.6, inside of what is thinner than two voxels.
double turned_deg(const Vec3& a, const Vec3& b, const Vec3& c, Surface::Probe& probe, double detail);

/// The intervals per edge that show the error of triangle abc: one per `detail` on its longest edge, but 3 at
/// least and 6 at most.
int error_steps(const Vec3& a, const Vec3& b, const Vec3& c, double detail);
/// The error of triangle abc with `error_steps` intervals per edge; where that is above 1.4 `refine_above`
/// or changes steeply, by 0.3 of the way between points or more, with 6 as well, and the larger of the two.
/// Its normal, too. `detail`: what is smaller need not be seen, at least the surface's resolution;
/// `refine_above`: as for `triangle_error`. What is found to be above `too_much` is looked at no
/// closer: its error is the one found so far, and its normal is not asked for.
TriangleError certified_error(const Vec3& a, const Vec3& b, const Vec3& c, Surface::Probe& probe,
                              double detail, double refine_above,
                              double too_much = std::numeric_limits<double>::infinity());

/// `triangle_error` of each triangle. Uses TBB inside; the result does not depend on the number of threads.
std::vector<TriangleError> triangle_errors(const std::vector<Vec3>& points,
                                           const std::vector<Triangle>& triangles, const Surface& surface,
                                           int steps,
                                           double refine_above = std::numeric_limits<double>::infinity());
/// The same of `certified_error`.
std::vector<TriangleError> certified_errors(const std::vector<Vec3>& points,
                                            const std::vector<Triangle>& triangles, const Surface& surface,
                                            double detail, double refine_above);
/// Without a list: `take` is called with the number of each triangle and its error, by several threads.
void certify_each(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                  const Surface& surface, double detail, double refine_above,
                  const std::function<void(std::size_t, const TriangleError&)>& take);

/// Where to put a particle that mends a facet of the boundary between inside and outside: the point of the
/// surface at the same distance from the facet's three vertices, on the dual edge between the circumcentres
/// of its two cells. No particle is nearer to it than those three, so what is inserted there breaks the facet
/// and leaves no short edge [Boissonnat, Oudot 2005]. nullopt where the dual does not cross the surface, as
/// between two sheets. `facet`: the index of the vertex of `cell`, a finite inside cell, that is opposite.
std::optional<Vec3> dual_crossing(const Tetrahedra& cells, const std::vector<Vec3>& points, int cell,
                                  int facet, Surface::Probe& probe);

/// A triangle as lattice crossings see it: it stands for those that leave the inside the way it faces (unit
/// normal . outward >= -0.2, since a crossed edge may lie nearly in the surface), so that one side of a thin
/// sheet does not stand for the other. For one without direction any triangle does.
class FacingTriangle {
public:
    FacingTriangle(const Vec3& a, const Vec3& b, const Vec3& c);
    /// Squared distance to a crossing; infinite when the triangle faces another way, and perhaps when it is
    /// above `limit`.
    double squared_distance(const Surface::Crossing& crossing, double limit) const;

private:
    Vec3 corner_[3], normal_;
    Vec3 out_[3];        // in the plane, from the edge after each corner away from it; zero without area
    double length2_[3];  // of these, and so of the edges
};

/// Distance of every lattice crossing of the surface to the nearest triangle that stands for it. In the order
/// of `grid`, world units. Exact up to `cutoff` but for the rounding to floats (there are many); infinite
/// beyond.
std::vector<float> crossing_distances(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                                      const CrossingGrid& grid, double cutoff);

/// The same for some crossings alone: their entries of `distances`; the others stay.
void crossing_distances(const std::vector<Vec3>& points, const std::vector<Triangle>& triangles,
                        const CrossingGrid& grid, std::vector<int> some, double cutoff,
                        std::vector<float>& distances);

}  // namespace isotrack
