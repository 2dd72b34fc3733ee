#include "tracking/registration.h"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "parallel_for_each.h"
#include "surface/thread_probes.h"
#include "tracking/oriented_places.h"
#include "tracking/pieces.h"

namespace isotrack {
namespace {

using Vec6 = Eigen::Matrix<double, 6, 1>;
using Mat6 = Eigen::Matrix<double, 6, 6>;

constexpr std::size_t kSamples = 24, kSamplesFromAfar = 12;  // of a piece, at most
constexpr int kMostSteps = 8;
constexpr double kArrived = 0.01;  // resolutions off the surface, root mean square
constexpr double kFar = 3.0;       // resolutions off: what sees no surface, or is farther
constexpr double kBetter = 0.98;   // times that of the step before
// Over kSamples, the weight of a piece: of a pair of pieces, of the motion of one, of that of one that rests.
// What comes from afar is stiff at first, so that limbs find those that are most like them, and bends as it
// likes in the end.
constexpr double kStiffness = 0.2, kStiffnessAfterwards = 0.002, kDamping = 1e-4, kHold = 0.2;
constexpr std::array<double, 4> kStiffnessFromAfar = {3.2, 0.8, 0.2, 0.05};  // of each step; the last goes on
constexpr int kMostStepsFromAfar = 15;
constexpr double kUnseen = 0.03;  // of the samples of a body: with more of them it comes from afar
constexpr double kCloser = 0.97;  // times what it was a step before, from afar
// Mean sizes of the pieces (its own, of one that nothing is beside): how far a place may be, so that a drop
// is not taken for any other. Mean sizes: what a right angle counts as.
constexpr double kReach = 1.35, kTurnLength = 2.0;
constexpr double kAlong = 0.3;       // of the weight across the surface, from afar
constexpr double kLeastSlope = 0.3;  // of the gradient: less is the edge of the band, or between two sheets
constexpr double kSameWay = 0.5;     // cosine between the turned normal and the surface's

Mat3 cross_matrix(const Vec3& v) {
    Mat3 m;
    m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
    return m;
}

using Lever = Eigen::Matrix<double, 6, 3>;
/// How far a turn and a shift take what is at the end of an arm, transposed.
Lever lever(const Vec3& arm) {
    Lever result;
    result << cross_matrix(arm), Mat3::Identity();
    return result;
}

/// What samples see of the surface.
struct Sight {
    double off2 = 0.0, samples = 0.0;  // squared distances off the surface; what sees none is far off
    double unseen = 0.0;               // samples

    void add(const Sight& other) {
        off2 += other.off2;
        samples += other.samples;
        unseen += other.unseen;
    }
    double off() const { return std::sqrt(off2 / samples); }
    bool has_arrived(double resolution) const { return !(off() > kArrived * resolution); }
};

/// The normal equations of a piece's own samples, for a turn and a shift of where it is.
struct Pull {
    Mat6 squares = Mat6::Zero();
    Vec6 products = Vec6::Zero();
    Sight sight;

    /// For a piece that nothing holds.
    Vec6 solve(double size2) const { return damped(size2).ldlt().solve(products); }
    /// `size2`: square of how far the piece reaches.
    Mat6 damped(double size2) const {
        Mat6 result = squares;
        result.diagonal().head<3>().array() += kDamping * kSamples * size2;
        result.diagonal().tail<3>().array() += kDamping * kSamples;
        return result;
    }
};

/// Calls `visit(x, n)` with some of its particles, where they are and face as it is now.
template <typename Visit>
void for_each_sample(const Piece& piece, std::size_t most, const Particles& particles, const Visit& visit) {
    const std::size_t step = 1 + (piece.particles.size() - 1) / most;
    for (std::size_t s = 0; s < piece.particles.size(); s += step) {
        const int i = piece.particles[s];
        visit(piece.moved(particles.position[i]), piece.turn * particles.normal[i]);
    }
}

/// By the surface's values.
Pull pull_in_sight(const Piece& piece, const Particles& particles, double robust, double resolution,
                   Surface::Probe& probe) {
    Pull pull;
    const double far = kFar * resolution;
    const Vec3 centre = piece.middle + piece.shift;
    for_each_sample(piece, kSamples, particles, [&](const Vec3& x, const Vec3& normal) {
        const Surface::Sample f = probe.sample(x);
        const double slope = f.gradient.norm();
        const Vec3 n = f.gradient / slope;
        pull.sight.samples += 1.0;
        pull.sight.off2 += far * far;
        if (!(slope > kLeastSlope && n.dot(normal) > kSameWay)) {
            pull.sight.unseen += 1.0;
            return;
        }
        const double off = f.value / slope, relative = off / robust;
        const double w = 1.0 / ((1.0 + relative * relative) * (1.0 + relative * relative));
        Vec6 row;
        row << (x - centre).cross(n), n;
        pull.squares += w * row * row.transpose();
        pull.products -= w * off * row;
        pull.sight.off2 += std::min(off * off - far * far, 0.0);
    });
    return pull;
}

/// By the places that are next to its samples, no farther than `reach`, and face as they do.
Pull pull_from_afar(const Piece& piece, const Particles& particles, double reach,
                    const OrientedPlaces& places) {
    Pull pull;
    const Vec3 centre = piece.middle + piece.shift;
    for_each_sample(piece, kSamplesFromAfar, particles, [&](const Vec3& x, const Vec3& n) {
        const auto& [point, normal] = places.nearest(x, n);
        const Vec3 way = x - point;
        pull.sight.samples += 1.0;
        if (!(way.squaredNorm() < reach * reach && n.dot(normal) > 0.0)) {
            pull.sight.off2 += reach * reach;
            return;
        }
        pull.sight.off2 += way.squaredNorm();
        const Lever rows = lever(x - centre);
        const Mat3 weight = normal * normal.transpose() + kAlong * Mat3::Identity();
        pull.squares += rows * weight * rows.transpose();
        pull.products -= rows * weight * way;
    });
    return pull;
}

/// Those of all pieces; returns what they see together.
template <typename PullOf>
Sight pull_all(std::vector<Pull>& pulls, const PullOf& of_piece) {
    parallel_for_each(pulls.size(), 4, [&](std::size_t k) { pulls[k] = of_piece(k); });
    Sight sum;
    for (const Pull& pull : pulls) sum.add(pull.sight);
    return sum;
}

/// Which pieces are of a body that is not in sight, but for a few of its samples.
std::vector<char> out_of_sight(const std::vector<Piece>& pieces, const std::vector<Pull>& pulls) {
    std::vector<char> result(pieces.size(), 0), met(pieces.size(), 0);
    for (std::size_t first = 0; first < pieces.size(); ++first) {
        if (std::exchange(met[first], 1)) continue;
        std::vector<int> body{static_cast<int>(first)};
        Sight sight;
        for (std::size_t next = 0; next < body.size(); ++next) {
            sight.add(pulls[body[next]].sight);
            for (const int l : pieces[body[next]].beside)
                if (!std::exchange(met[l], 1)) body.push_back(l);
        }
        if (sight.unseen > kUnseen * sight.samples)
            for (const int k : body) result[k] = 1;
    }
    return result;
}

/// Those of some pieces that are on the surface from the start. What comes from afar beside them would take
/// them along, where they slide in themselves.
class Resting {
public:
    Resting() = default;
    Resting(const std::vector<Piece>& pieces, const std::vector<char>& some, const std::vector<Pull>& pulls,
            double resolution)
        : start_(pieces), rests_(some) {
        for (std::size_t k = 0; k < pieces.size(); ++k)
            rests_[k] = some[k] && pulls[k].sight.has_arrived(resolution);
    }
    bool rests(std::size_t k) const { return !rests_.empty() && rests_[k]; }
    /// Pulls piece k, which rests, back to where it was.
    void hold(std::size_t k, const Piece& piece, Pull& pull) const {
        const double shift_weight = kHold * kSamples, turn_weight = shift_weight * piece.size2;
        const Eigen::AngleAxisd turned(piece.turn * start_[k].turn.transpose());
        pull.squares.diagonal().head<3>().array() += turn_weight;
        pull.squares.diagonal().tail<3>().array() += shift_weight;
        pull.products.head<3>() -= turn_weight * turned.angle() * turned.axis();
        pull.products.tail<3>() -= shift_weight * (piece.shift - start_[k].shift);
    }

private:
    std::vector<Piece> start_;
    std::vector<char> rests_;
};

using SparseMatrix = Eigen::SparseMatrix<double>;

/// By minimum degree, of a matrix with both halves. Eigen's own ordering would add the transposed matrix
/// first, which has the same entries: the same order, but three matrices at once instead of two.
struct SymmetricOrdering {
    using Order = Eigen::AMDOrdering<int>::PermutationType;
    void operator()(const SparseMatrix& matrix, Order& order) const {
        Eigen::AMDOrdering<int>()(matrix.selfadjointView<Eigen::Lower>(), order);
    }
};
using Solver = Eigen::SimplicialLDLT<SparseMatrix, Eigen::Lower, SymmetricOrdering>;

/// The linear equations for a turn and a shift of each piece: their pulls, and what holds those beside each
/// other. Of the matrix, which is symmetric, there is the lower half.
class Equations {
public:
    explicit Equations(const std::vector<Piece>& pieces) : first_(pieces.size(), kNone) {
        constexpr std::size_t kOwn = 6 * 7 / 2, kOfOther = 6 * 3 + 3;  // entries that `add` makes
        std::size_t entries = 0;
        for (std::size_t k = 0; k < pieces.size(); ++k) {
            if (pieces[k].beside.empty()) continue;
            first_[k] = std::exchange(unknowns_, unknowns_ + 6);
            entries += kOwn + kOfOther * pieces[k].beside.size();
        }
        entries_.reserve(entries);
        right_.setZero(unknowns_);
    }

    void add(const std::vector<Piece>& pieces, std::size_t k, const Pull& pull, double resolution,
             double stiffness) {
        const Piece& piece = pieces[k];
        const Eigen::Index first = first_[k];
        const double hold = stiffness * kSamples;
        double size2 = resolution * resolution;
        Mat6 own = Mat6::Zero();
        right_.segment<6>(first) += pull.products;
        for (const int l : piece.beside) {
            // Where this piece would take the middle of the one beside it, less where that takes it.
            const Piece& other = pieces[l];
            const Vec3 arm = piece.turn * (other.middle - piece.middle),
                       apart = piece.moved(other.middle) - (other.middle + other.shift);
            const Lever here = lever(arm);
            const Eigen::Index shift = first_[l] + 3;
            own += hold * here * here.transpose();
            if (l < static_cast<int>(k))
                add_block(first, shift, -hold * here);
            else
                add_block(shift, first, -hold * here.transpose());
            for (int axis = 0; axis < 3; ++axis) add_entry(shift + axis, shift + axis, hold);
            right_.segment<6>(first) -= hold * here * apart;
            right_.segment<3>(shift) += hold * apart;
            size2 = std::max(size2, arm.squaredNorm());
        }
        own += pull.damped(size2);
        for (int a = 0; a < 6; ++a)
            for (int b = 0; b <= a; ++b) add_entry(first + a, first + b, own(a, b));
    }

    /// From `first(k)` on a turn and a shift. Nothing where there is no answer. `solver`: that of equations
    /// for the same pieces, or a new one. To be called once: it frees the entries, of which there are many.
    Eigen::VectorXd solve(Solver& solver) {
        if (unknowns_ == 0) return right_;
        SparseMatrix matrix(unknowns_, unknowns_);
        matrix.setFromTriplets(entries_.begin(), entries_.end());
        entries_ = std::vector<Eigen::Triplet<double>>();
        if (solver.rows() != unknowns_) solver.analyzePattern(matrix);
        solver.factorize(matrix);
        if (solver.info() != Eigen::Success) return {};
        Eigen::VectorXd solution = solver.solve(right_);
        if (!solution.allFinite()) solution.resize(0);
        return solution;
    }

    Eigen::Index first(std::size_t k) const { return first_[k]; }

private:
    void add_entry(Eigen::Index row, Eigen::Index column, double value) {
        entries_.emplace_back(static_cast<int>(row), static_cast<int>(column), value);
    }
    template <typename Block>
    void add_block(Eigen::Index row, Eigen::Index column, const Block& block) {
        for (Eigen::Index a = 0; a < block.rows(); ++a)
            for (Eigen::Index b = 0; b < block.cols(); ++b) add_entry(row + a, column + b, block(a, b));
    }

    static constexpr Eigen::Index kNone = -1;
    std::vector<Eigen::Index> first_;  // unknown of each piece; none for what nothing holds
    Eigen::Index unknowns_ = 0;
    std::vector<Eigen::Triplet<double>> entries_;
    Eigen::VectorXd right_;
};

/// Takes a step, with the stiffness that each has; false where there is no answer.
bool step_on(std::vector<Piece>& pieces, const std::vector<Pull>& pulls, double resolution,
             const std::vector<double>& stiffness, Solver& solver) {
    Equations equations(pieces);
    for (std::size_t k = 0; k < pieces.size(); ++k)
        if (!pieces[k].beside.empty()) equations.add(pieces, k, pulls[k], resolution, stiffness[k]);
    const Eigen::VectorXd solution = equations.solve(solver);
    for (std::size_t k = 0; k < pieces.size(); ++k)
        if (!pieces[k].beside.empty() && solution.size() == 0) return false;
    parallel_for_each(pieces.size(), 64, [&](std::size_t k) {
        Vec6 own;
        if (pieces[k].beside.empty())
            own = pulls[k].solve(std::max(pieces[k].size2, resolution * resolution));
        else
            own = solution.segment<6>(equations.first(k));
        if (!own.allFinite()) return;
        const double angle = own.head<3>().norm();
        if (angle > 0.0)
            pieces[k].turn =
                Eigen::AngleAxisd(angle, own.head<3>() / angle).toRotationMatrix() * pieces[k].turn;
        pieces[k].shift += own.tail<3>();
    });
    return true;
}

/// Brings pieces to a surface.
class Registration {
public:
    Registration(const Surface& surface, const Particles& particles, std::size_t pieces)
        : surface_(surface),
          resolution_(surface.resolution()),
          particles_(particles),
          probes_(surface),
          pulls_(pieces) {}

    /// Makes the pulls by the surface's values. What is farther off than `robust` counts less.
    Sight look(const std::vector<Piece>& pieces, double robust, const Resting& resting) {
        return pull_all(pulls_, [&](std::size_t k) {
            Pull pull = pull_in_sight(pieces[k], particles_, robust, resolution_, probes_.local());
            if (resting.rests(k)) resting.hold(k, pieces[k], pull);
            return pull;
        });
    }
    /// The same for the first time.
    Sight look(const std::vector<Piece>& pieces, const Resting& resting = {}) {
        return look(pieces, 2.0 * resolution_, resting);
    }
    const std::vector<Pull>& pulls() const { return pulls_; }

    /// By the surface's values, after a look at them; they stay where they come nearest. Returns how far off
    /// that is.
    double settle(std::vector<Piece>& pieces, Sight sight, const std::vector<double>& stiffness,
                  const Resting& resting = {}) {
        std::vector<Piece> next = pieces;
        double least = std::numeric_limits<double>::infinity();
        for (int step = 0; sight.off() < least; ++step) {
            const bool is_enough = sight.has_arrived(resolution_) || !(sight.off() < kBetter * least);
            least = sight.off();
            if (step > 0) pieces = next;
            if (is_enough || step == kMostSteps || !step_on(next, pulls_, resolution_, stiffness, solver_))
                break;
            sight = look(next, std::max(resolution_, 2.0 * least), resting);
        }
        return least;
    }

    /// Brings some, of bodies of their own, to what is like them in place and normal: iterative closest
    /// points [Besl and McKay 1992], less stiff with each step [Amberg et al. 2007]. False where there is
    /// nothing or no answer.
    bool bring_from_afar(const std::vector<char>& some, std::vector<Piece>& pieces,
                         const CrossingGrid& crossings, const Resting& resting) {
        double sizes = 0.0, count = 0.0;
        for (std::size_t k = 0; k < pieces.size(); ++k) {
            sizes += some[k] ? std::sqrt(pieces[k].size2) : 0.0;
            count += some[k] ? 1.0 : 0.0;
        }
        const double size = sizes / count;
        const OrientedPlaces places(surface_, crossings, kTurnLength * size);
        if (places.empty()) return false;
        std::vector<Piece> next = pieces;
        double before = std::numeric_limits<double>::infinity();
        for (int step = 0; step < kMostStepsFromAfar; ++step) {
            const Sight sight = pull_all(pulls_, [&](std::size_t k) {
                Pull pull;
                if (resting.rests(k)) {
                    resting.hold(k, next[k], pull);
                } else if (some[k]) {
                    const double of = next[k].beside.empty() ? std::sqrt(next[k].size2) : size;
                    pull = pull_from_afar(next[k], particles_, kReach * of, places);
                }
                return pull;
            });
            const bool gets_looser = step < static_cast<int>(kStiffnessFromAfar.size());
            if (!gets_looser && !(sight.off() < kCloser * before)) break;
            before = sight.off();
            const double stiffness = gets_looser ? kStiffnessFromAfar[step] : kStiffnessFromAfar.back();
            if (!step_on(next, pulls_, resolution_, std::vector<double>(next.size(), stiffness), solver_))
                return false;
        }
        for (std::size_t k = 0; k < pieces.size(); ++k)
            if (some[k]) pieces[k] = std::move(next[k]);
        return true;
    }

private:
    const Surface& surface_;
    const double resolution_;
    const Particles& particles_;
    ThreadProbes probes_;
    std::vector<Pull> pulls_;
    Solver solver_;
};

}  // namespace

std::optional<std::vector<Vec3>> register_to(const Surface& surface, const Crossings& crossings,
                                             const Particles& particles, const Adjacency& ring,
                                             const std::vector<Vec3>& guess) {
    std::vector<Piece> pieces = make_pieces(ring, particles.position);
    parallel_for_each(pieces.size(), 16,
                      [&](std::size_t k) { move_as(particles.position, guess, pieces[k]); });
    Registration registration(surface, particles, pieces.size());
    std::vector<double> stiffness(pieces.size(), kStiffness);
    Sight sight = registration.look(pieces);
    if (sight.has_arrived(surface.resolution())) return std::nullopt;
    const double off = sight.off();
    const std::vector<char> afar = out_of_sight(pieces, registration.pulls());
    if (std::find(afar.begin(), afar.end(), 1) != afar.end()) {
        const Resting resting(pieces, afar, registration.pulls(), surface.resolution());
        std::vector<Piece> come = pieces;
        if (registration.bring_from_afar(afar, come, crossings(), resting)) {
            std::vector<double> looser = stiffness;
            for (std::size_t k = 0; k < pieces.size(); ++k)
                if (afar[k]) looser[k] = kStiffnessAfterwards;
            const Sight there = registration.look(come, resting);
            if (registration.settle(come, there, looser, resting) < off)
                return blended(come, particles.position);
        }
        sight = registration.look(pieces);
    }
    if (!(registration.settle(pieces, sight, stiffness) < off)) return std::nullopt;
    return blended(pieces, particles.position);
}

}  // namespace isotrack
