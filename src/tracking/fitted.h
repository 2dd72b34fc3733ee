// The fit of one frame's meshes, each a little different from the one before.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "isotrack/surface/surface.h"
#include "tracking/frame_mesh.h"
#include "tracking/kept_flips.h"

namespace isotrack {

/// Where the vertices of the last mesh were fitted to, and which edges were flipped for it.
class Fitted {
public:
    /// Fits the first mesh, and flips edges that keep its triangles from their surface. `tolerance`: what
    /// none of these may come to be beyond by a flip; without it none flips. Of the next meshes it fits anew
    /// the corners of triangles that the last did not have; the rest goes to where it was, with the same
    /// flips where all their triangles are there. A mesh of which more than half is new counts as the
    /// first. A flipped triangle keeps the cell and facet of the one in whose place it is. `particles`: how
    /// many there are; in all these meshes they are in the same places.
    void fit_vertices(FrameMesh& mesh, std::size_t particles, const Surface& surface,
                      std::optional<double> tolerance);

    /// Puts vertices and edges back where triangles cross others, a ring further each time, until none cross.
    /// Facets of a DT do not. Returns whether any did. `particles`: where they are.
    bool undo_crossing(FrameMesh& mesh, const std::vector<Vec3>& particles);

private:
    void take(const FrameMesh& mesh, std::size_t particles);

    struct FacetOfParticles {
        int key;  // `facet_key`
        Triangle corner;
        bool operator==(const FacetOfParticles& o) const {
            return key >= 0 && key == o.key && corner == o.corner;
        }
    };
    std::vector<FacetOfParticles> facets_;
    std::vector<Eigen::Vector3f> position_;  // per particle
    KeptFlips flips_;
};

}  // namespace isotrack
