// The error of one triangle of a large mesh.
#pragma once

#include "isotrack/meshing/certify.h"

namespace isotrack {

/// A `TriangleError` in 32 bytes, the place and the angle as floats: there are two for each particle, and
/// again two of another mesh. Made of one wherever that is asked about.
struct FacetError {
    double largest = 0.0, mean_square = 0.0;
    Eigen::Vector3f where = Eigen::Vector3f::Zero();
    float turned_deg = 0.0f;

    FacetError() = default;
    FacetError(const TriangleError& error)
        : largest(error.largest),
          mean_square(error.mean_square),
          where(error.where.cast<float>()),
          turned_deg(static_cast<float>(error.turned_deg)) {}
};
static_assert(sizeof(FacetError) == 32);

}  // namespace isotrack
