// The tracker: particles on a deforming surface from one frame to the next, and a mesh of each.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "isotrack/delaunay/tetrahedralisation.h"
#include "isotrack/sampling/particles.h"
#include "isotrack/sampling/sizing.h"
#include "isotrack/surface/surface.h"
#include "isotrack/types.h"

namespace isotrack {

enum class Method {
    Tolerance,  ///< Spacing from the measured error, fed back: fewest triangles for a tolerance.
    Paper       ///< The paper's angle-driven metric, Gaussian energy, coordinate descent and thresholds; the
                ///< tolerance is only checked.
};

enum class Reconstruction {
    Guided,  ///< Cells labelled inside or outside with the help of the level set.
    Pure     ///< The geometric convection of the particles alone, as in the paper; for comparison.
};

/// What becomes of a surface that runs into the border of its grid.
enum class Border {
    Close,  ///< It is closed there by a flat cap.
    Open    ///< The cap is left out of the mesh, see `open_border`; particles are on it all the same.
};

/// A bound that rarely matters beside a tolerance (60 degrees); what the whole spacing follows in the paper's
/// method (20 degrees).
double default_angle_deg(Method method);

/// All lengths in world units.
struct TrackerOptions {
    /// > 0. Largest wanted distance between mesh and surface, either way; see `effective_tolerance`.
    double tolerance = 0.0;
    std::optional<double> angle_deg;  ///< Wanted angle between neighbours' normals, degrees in (0, 90].
                                      ///< Unset: `default_angle_deg`.
    std::optional<double> min_edge;   ///< Smallest spacing. Unset: half the surface's resolution or the
                                      ///< tolerance, whichever is larger (in the paper's method the former).
    std::optional<double> max_edge;   ///< Largest spacing. Unset: 80 times that.
    Method method = Method::Tolerance;
    Reconstruction reconstruction = Reconstruction::Guided;
    Border border = Border::Close;
    UpdateStrategy delaunay = UpdateStrategy::Auto;  ///< In the paper's method Auto is Lazy, as there.
    bool fit = false;  ///< Vertices leave the surface so that the triangles are nearer to it; particles stay.
    std::uint64_t seed = 1;  ///< Same seed, same surfaces: same meshes, at any thread count.
};

/// The tolerance, but no more than 0.85 of the surface's `reach()`: beyond it distances are not known.
double effective_tolerance(const TrackerOptions& options, const Surface& surface);

/// What these options come to on a surface. The tolerance is of values, which are less than distances where
/// the surface's `slope()` is below 1.
SizingLimits sizing_limits(const TrackerOptions& options, const Surface& surface);

/// Degrees: a mesh with a triangle that is turned from the surface by as much or more is not certified.
constexpr double kTurnedOverDeg = 90.0;

/// What became of one frame.
struct TrackedFrame {
    /// Closed, oriented, 2-manifold; per vertex the id and the velocity (displacement since the last frame)
    /// of its particle, beside which it may stand: moved by the fit, or along the surface where triangles
    /// were sharp. Drops too small for tetrahedra have no particles, nor have parts that the lattice of the
    /// surface is taken for, which is the whole mesh where all is noise: new ids in every frame, and no
    /// velocity.
    TriangleMesh mesh;
    /// Vertices beyond these are copies that keep the mesh manifold, or stand on none of them.
    std::size_t particles = 0;
    std::size_t born = 0, died = 0, seeded = 0, lost = 0;
    int sweeps = 0;             ///< Relaxation sweeps, over those particles that had to move.
    std::size_t relocated = 0;  ///< Vertices the tetrahedralisation moved one by one.
    std::size_t rebuilt = 0;    ///< So often that of the mesh was built anew.
    std::string delaunay_strategy;
    double tolerance = 0.0;  ///< The effective one.
    /// The larger of the distances mesh to surface (values over the surface's slope, at up to 28 points of
    /// each triangle) and back (at the lattice crossings, of which those nearer to each other than two
    /// tolerances stand for one another, and four for all of a flat sheet in a cube of four tolerances; where
    /// they are so far apart anyway also at points between those that
    /// are nearly too far off, at folds of the mesh, or in cells with an ambiguous face, but for points that
    /// no vertex on the surface reaches), measured on `mesh`, world units; RMS likewise, but for the points
    /// between. What is farther than about three tolerances from any triangle that faces its way is counted
    /// as lost instead.
    double max_error = 0.0, rms_error = 0.0;
    /// The largest angle between a triangle and the surface, by `turned_deg`: where it is above 60
    /// degrees certify adds particles.
    double most_turned_deg = 0.0;
    bool opened = false;             ///< A cap was left out: the mesh has a border there.
    std::size_t lost_crossings = 0;  ///< Features below the grid's resolution that the mesh does not hold.
    /// max_error is at most the tolerance, nothing is lost and nothing turned over. Not so, too, where
    /// following every detail would take more particles than half the lattice crossings (at half a voxel;
    /// more at less).
    bool within_tolerance = true;
    /// Per stage: carry, cover, size, relax, delaunay, convect, fit, certify, blunt. The lattice crossings are
    /// found beside the carry; cover has what they take longer, and the seeding.
    std::map<std::string, double> seconds;
};

/// Follows one surface. Not for concurrent use: frames depend on each other. Uses TBB inside.
class Tracker {
public:
    /// \throws OptionError for an option outside its range.
    explicit Tracker(const TrackerOptions& options);
    ~Tracker();
    Tracker(Tracker&&) noexcept;
    Tracker& operator=(Tracker&&) noexcept;

    /// Where a point of the last frame is expected in the next: a velocity field's guess.
    using Motion = std::function<Vec3(const Vec3&)>;

    /// Goes on to the next frame, or starts. Without `motion` the particles move as
    /// the surfaces themselves show, along them, too: from their last displacements on, each piece as rigidly
    /// as it can. An empty surface gives an empty mesh and drops all particles; the next surface with
    /// something in it starts afresh, ids counting on. After a frame that failed, as when memory ran out or
    /// the surface threw, the next goes on with the particles as they are then.
    TrackedFrame advance(const Surface& surface, const Motion& motion = {});

    /// What is left to do of a frame when its particles are final. To be called once, on any thread, beside
    /// the tracker's next frames if one likes.
    using Finish = std::function<TrackedFrame()>;

    /// The same in two steps; `surface` must live until the second is done.
    Finish begin(const Surface& surface, const Motion& motion = {});

    /// The particles of the last frame.
    const Particles& particles() const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace isotrack
