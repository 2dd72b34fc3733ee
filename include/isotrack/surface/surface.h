// What the method knows of a surface: a value, a gradient, and the two operators made of them.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "isotrack/types.h"

namespace isotrack {

/// A closed surface given as the zero set of a function that is negative inside.
///
/// Near the surface the value is a distance in world units, to first order. A `Surface` itself is immutable
/// and may be shared by threads; each thread asks through its own `Probe`, because the grids behind it cache
/// their last access.
class Surface {
public:
    struct Sample {
        double value;   ///< World units, negative inside.
        Vec3 gradient;  ///< World units per world unit; about 1 long near the surface, 0 where nothing is
                        ///< known.
    };

    /// One thread's access to a surface. Cheap to make; must not outlive the surface nor be shared by
    /// threads.
    class Probe {
    public:
        virtual ~Probe() = default;

        /// Right in sign everywhere; right in size near the surface: within the band of a grid.
        virtual double value(const Vec3& p) = 0;

        /// The value, or another that is farther off on the same side, by up to twice, where the surface may
        /// be read in more than one way: what meshes are held to. Right in size below `Surface::reach()`, and
        /// no less than that beyond.
        virtual double farther_value(const Vec3& p) { return value(p); }
        /// The same at `count` points, into as many `values`: takes less time than one after the other where
        /// a grid is too large for the caches.
        virtual void farther_values(const Vec3* points, std::size_t count, double* values) {
            for (std::size_t i = 0; i < count; ++i) values[i] = farther_value(points[i]);
        }

        /// Value and gradient together, for less than the price of both.
        virtual Sample sample(const Vec3& p) = 0;

        /// Values at the corners of a lattice cell: corner k is bit 0 of k along the first axis, bit 1 along
        /// the second, bit 2 along the third.
        using CellValues = std::array<double, 8>;
        /// Those of the cell whose lowest node is `low`, in whole numbers of `lattice`: the surface's own,
        /// which not every probe knows. They must be below 0 where `crossing_sequence` has nodes inside.
        virtual CellValues cell_values(const Vec3& low, const Eigen::Affine3d& lattice);

        /// O1: a point of the surface near `p` by the damped Newton iteration of the paper's algorithm 4,
        /// each step at most one resolution long. nullopt when there is no way to the surface from here: no
        /// gradient (outside the band), or no convergence. Override when a formula for the closest point is
        /// known.
        virtual std::optional<Vec3> project(const Vec3& p);

        /// O2: the unit outward normal, the normalised gradient; zero where there is no gradient.
        virtual Vec3 normal(const Vec3& p);

    protected:
        /// `epsilon`: a projected point has |value| below this. `max_step`: longest Newton step. World units.
        Probe(double epsilon, double max_step) : epsilon_(epsilon), max_step_(max_step) {}

    private:
        double epsilon_, max_step_;
        // The last projection: its normal is mostly asked for next.
        Vec3 projected_ = Vec3::Constant(std::numeric_limits<double>::quiet_NaN());
        Vec3 gradient_ = Vec3::Zero();
    };

    virtual ~Surface() = default;
    virtual std::unique_ptr<Probe> probe() const = 0;

    /// Length of the smallest detail, world units: the voxel size for a grid.
    virtual double resolution() const = 0;

    /// How far from the surface distances are known, world units.
    virtual double reach() const { return std::numeric_limits<double>::infinity(); }

    /// Mean length of the gradient at the surface, in (0, 1]: less than 1 where values are interpolated
    /// around what is a few resolutions small. Distances near the surface are the values over it.
    virtual double slope() const { return 1.0; }

    /// A finite box that holds the surface and little more, since what looks up places is laid out over it;
    /// empty when there is no surface.
    virtual Box bounds() const = 0;

    /// Whether a point of the surface is at the border of what is known, where the surface is closed by a
    /// cap.
    virtual bool at_border(const Vec3&) const { return false; }

    /// From the whole numbers of a lattice of spacing `resolution()` to the world: the voxels of a grid.
    virtual Eigen::Affine3d lattice() const;

    /// Where an edge between neighbouring lattice nodes crosses the surface.
    struct Crossing {
        Vec3 point;  ///< Linearly interpolated along the edge.
        /// Unit direction of the edge, from its end inside to its end outside. Zero where it is of no matter
        /// which way a mesh faces.
        Eigen::Vector3f outward;
        std::int16_t stands_for = 1;  ///< So many crossings, itself among them: 32 767 at most.
        bool flat = false;            ///< The surface is a flat sheet where they are.
    };

    /// Crossings that are made when they are asked for: a list of them would take more memory than all else.
    /// Must not outlive the surface; threads may share it.
    struct CrossingSequence {
        /// Writes those from `first` on, up to `end`, one after the other; the same whenever it is asked to.
        using Write = std::function<void(std::size_t first, std::size_t end, Crossing* to)>;
        std::size_t size = 0;
        Write write;  ///< May be unset where there are none.

        CrossingSequence() = default;
        CrossingSequence(std::size_t count, Write make) : size(count), write(std::move(make)) {}
        /// Of a list that is there. It can be copied, has a `size()`, and a `list[i]` that becomes a
        /// crossing, which threads may ask for at once.
        template <typename List>
        explicit CrossingSequence(List list)
            : size(list.size()),
              write([held = std::move(list)](std::size_t first, std::size_t end, Crossing* to) {
                  for (; first < end; ++first) *to++ = held[first];
              }) {}

        /// Calls `visit(crossing)` for each from `first` on, up to `end`.
        template <typename Visit>
        void for_each_in(std::size_t first, std::size_t end, const Visit& visit) const {
            constexpr std::size_t kAtOnce = 64;
            Crossing some[kAtOnce];
            for (std::size_t next; first < end; first = next) {
                next = std::min(end, first + kAtOnce);
                write(first, next, some);
                for (std::size_t i = 0; i < next - first; ++i) visit(some[i]);
            }
        }
    };
    /// The crossings of `lattice()`: every part of the surface wider than a lattice cell holds some. Always
    /// in the same order. Of those within a cube of an edge of about `apart` some along one axis may stand
    /// for all: one that goes out and one that goes in, where there are both; where the surface is a flat
    /// sheet, four within a cube of about four times that. This default scans `bounds()` and gives all.
    virtual CrossingSequence crossing_sequence(double apart) const;
    /// A list of them.
    std::vector<Crossing> crossings(double apart = 0.0) const;
    /// All of them in boxes around some places, `reach` to each side, and others nearby. This default, which
    /// lets none stand for others, has none.
    virtual std::vector<Crossing> crossings_near(const std::vector<Vec3>& /*places*/,
                                                 double /*reach*/) const {
        return {};
    }
    /// The lower ends of the crossed edges along the lattice's third axis, in any order.
    virtual std::vector<Eigen::Vector3i> upright_crossings() const;

    /// Two nodes of `lattice()` on one side of the surface, joined across the diagonal of a face whose other
    /// two nodes are on the other side.
    struct Diagonal {
        Vec3 from, to;   ///< The nodes; the surface does not pass between them.
        Vec3 beside[2];  ///< Where it crosses the face's other diagonal.
    };

    /// Those of a surface that says how nodes are joined; this default has none.
    virtual std::vector<Diagonal> diagonals() const { return {}; }
    /// The surface that parts the lattice nodes, joined as `diagonals` says: closed, with vertices at each
    /// crossing (a little off the nodes), in every cell that it passes through and on the faces between, all
    /// near the surface if not on it. At least what is in cubes around some places, `reach` to each side, and
    /// open beyond. This default has none.
    virtual TriangleMesh lattice_mesh(const std::vector<Vec3>& /*places*/, double /*reach*/) const {
        return {};
    }
    /// All of it, with few triangles, within `close` of the crossings instead of through them, and none that
    /// cross. Empty where there is no such mesh, as for this default.
    virtual TriangleMesh light_lattice_mesh(double /*close*/) const { return {}; }
    /// Of that mesh, for much less than its price: the Euler number.
    virtual std::optional<long> lattice_euler() const { return std::nullopt; }
    /// And how many components it has.
    virtual std::optional<std::size_t> lattice_component_count() const { return std::nullopt; }
    /// They themselves, each by the box of its crossings, for a part of the price.
    virtual std::optional<std::vector<Box>> lattice_components() const { return std::nullopt; }
};

}  // namespace isotrack
