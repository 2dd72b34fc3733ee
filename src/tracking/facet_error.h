// The error of one triangle of a large mesh.
#pragma once

#include "isotrack/meshing/certify.h"

namespace isotrack {

/// A `TriangleError` in floats: there are two for each particle, and again two of another mesh. Made of one
/// wherever that is asked about.
struct FacetError {
    float largest = 0.0f, mean_square = 0.0f, turned_deg = 0.0f;
    Eigen::Vector3f where = Eigen::Vector3f::Zero();

    FacetError() = default;
    FacetError(const TriangleError& error)
        : largest(static_cast<float>(error.largest)),
          mean_square(static_cast<float>(error.mean_square)),
          turned_deg(static_cast<float>(error.turned_deg)),
          where(error.where.cast<float>()) {}
};

}  // namespace isotrack
