#include "tracking/registration.h"

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
// Over the weight of the samples of a piece: of a pair of pieces, of the motion of one, of that of one that
// rests. What comes from afar is stiff at first, so that limbs find those that are most like them, and bends
// as it likes in the end.
constexpr double kStiffness = 0.2, kStiffnessAfterwards = 0.002, kDamping = 1e-4, kHold = 0.2;
constexpr std::array<double, 4> kStiffnessFromAfar = {3.2, 0.8, 0.2, 0.05};  // of each step; the last goes on
constexpr int kMostStepsFromAfar = 15;
constexpr double kUnseen = 0.03;  // of the samples: with more of them the pieces come from afar
constexpr double kCloser = 0.97;  // times what it was a step before, from afar
// Mean sizes of the pieces: how far a place may be, so that a drop is not taken for any other, and what a
// right angle counts as.
constexpr double kReach = 1.5, kTurnLength = 2.0;
constexpr double kAlong = 0.3;       // of the weight across the surface, from afar
constexpr double kLeastSlope = 0.3;  // of the gradient: less is the edge of the band, or between two sheets
constexpr double kSameWay = 0.5;     // cosine between the turned normal and the surface's

Mat3 cross_matrix(const Vec3& v) {
    Mat3 m;
    m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
    return m;
}

/// The normal equations of a piece's own samples, for a turn and a shift of where it is.
struct Pull {
    Mat6 squares = Mat6::Zero();
    Vec6 products = Vec6::Zero();
    double off2 = 0.0, samples = 0.0;  // squared distances off the surface; what sees none is far off
    double unseen = 0.0;               // samples

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

Pull pull_of(const Piece& piece, const Particles& particles, double robust, double resolution,
             Surface::Probe& probe) {
    Pull pull;
    const double far = kFar * resolution;
    const std::size_t step = 1 + (piece.particles.size() - 1) / kSamples;
    const Vec3 centre = piece.middle + piece.shift;
    for (std::size_t s = 0; s < piece.particles.size(); s += step) {
        const int i = piece.particles[s];
        const Vec3 x = piece.moved(particles.position[i]);
        const Surface::Sample f = probe.sample(x);
        const double slope = f.gradient.norm();
        const Vec3 n = f.gradient / slope;
        pull.samples += 1.0;
        pull.off2 += far * far;
        if (!(slope > kLeastSlope && n.dot(piece.turn * particles.normal[i]) > kSameWay)) {
            pull.unseen += 1.0;
            continue;
        }
        const double off = f.value / slope, relative = off / robust;
        const double w = 1.0 / ((1.0 + relative * relative) * (1.0 + relative * relative));
        Vec6 row;
        row << (x - centre).cross(n), n;
        pull.squares += w * row * row.transpose();
        pull.products -= w * off * row;
        pull.off2 += std::min(off * off - far * far, 0.0);
    }
    return pull;
}

/// By the places that are next to its samples, no farther than `reach`, and face as they do.
Pull pull_from_afar(const Piece& piece, const Particles& particles, double reach,
                    const OrientedPlaces& places) {
    Pull pull;
    const std::size_t step = 1 + (piece.particles.size() - 1) / kSamplesFromAfar;
    const Vec3 centre = piece.middle + piece.shift;
    for (std::size_t s = 0; s < piece.particles.size(); s += step) {
        const int i = piece.particles[s];
        const Vec3 x = piece.moved(particles.position[i]), n = piece.turn * particles.normal[i];
        const auto& [point, normal] = places.nearest(x, n);
        const Vec3 way = x - point;
        pull.samples += 1.0;
        pull.off2 += std::min(way.squaredNorm(), reach * reach);
        if (!(way.norm() < reach && n.dot(normal) > 0.0)) continue;
        Eigen::Matrix<double, 6, 3> rows;
        rows << cross_matrix(x - centre), Mat3::Identity();
        const Mat3 weight = normal * normal.transpose() + kAlong * Mat3::Identity();
        pull.squares += rows * weight * rows.transpose();
        pull.products -= rows * weight * way;
    }
    return pull;
}

/// Pieces that are on the surface from the start. What comes from afar beside them would take them along,
/// where they slide in themselves.
class Resting {
public:
    void take(const std::vector<Piece>& pieces, const std::vector<Pull>& pulls, double resolution) {
        start_ = pieces;
        for (const Pull& pull : pulls)
            rests_.push_back(pull.off2 < kArrived * kArrived * resolution * resolution * pull.samples);
    }
    /// Pulls piece k back to where it was, if it is one of them.
    void hold(std::size_t k, const Piece& piece, Pull& pull) const {
        if (rests_.empty() || !rests_[k]) return;
        constexpr double kShiftWeight = kHold * kSamples;
        const double turn_weight = kShiftWeight * piece.size2;
        const Eigen::AngleAxisd turned(piece.turn * start_[k].turn.transpose());
        pull.squares.diagonal().head<3>().array() += turn_weight;
        pull.squares.diagonal().tail<3>().array() += kShiftWeight;
        pull.products.head<3>() -= turn_weight * turned.angle() * turned.axis();
        pull.products.tail<3>() -= kShiftWeight * (piece.shift - start_[k].shift);
    }

private:
    std::vector<Piece> start_;
    std::vector<char> rests_;
};

/// Those of all pieces, and the sum of what was met.
template <typename PullOf>
Pull pull_all(std::vector<Pull>& pulls, const PullOf& pull_of) {
    parallel_for_each(pulls.size(), 4, [&](std::size_t k) { pulls[k] = pull_of(k); });
    Pull sum;
    for (const Pull& pull : pulls) {
        sum.off2 += pull.off2;
        sum.samples += pull.samples;
        sum.unseen += pull.unseen;
    }
    return sum;
}

using SparseMatrix = Eigen::SparseMatrix<double>;
using Solver = Eigen::SimplicialLDLT<SparseMatrix, Eigen::Lower>;

/// The linear equations for a turn and a shift of each piece: their pulls, and what holds those beside each
/// other. Of the matrix, which is symmetric, there is the lower half.
class Equations {
public:
    explicit Equations(const std::vector<Piece>& pieces) : first_(pieces.size(), kNone) {
        for (std::size_t k = 0; k < pieces.size(); ++k)
            if (!pieces[k].beside.empty()) first_[k] = std::exchange(unknowns_, unknowns_ + 6);
        right_.setZero(unknowns_);
    }

    void add(const std::vector<Piece>& pieces, std::size_t k, const Pull& pull, double resolution,
             double stiffness) {
        using Row = Eigen::Matrix<double, 6, 3>;
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
            Row here;
            here << cross_matrix(arm), Mat3::Identity();
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

/// Takes a step; false where there is no answer.
bool step_on(std::vector<Piece>& pieces, const std::vector<Pull>& pulls, double resolution, double stiffness,
             Solver& solver) {
    Equations equations(pieces);
    for (std::size_t k = 0; k < pieces.size(); ++k)
        if (!pieces[k].beside.empty()) equations.add(pieces, k, pulls[k], resolution, stiffness);
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

/// Brings them to what is like them in place and normal: iterative closest points [Besl and McKay 1992], less
/// stiff with each step [Amberg et al. 2007]. False where there is nothing or no answer.
bool come_from_afar(std::vector<Piece>& pieces, const Resting& resting, const Surface& surface,
                    const CrossingGrid& crossings, const Particles& particles, Solver& solver) {
    double size = 0.0;
    for (const Piece& piece : pieces) size += std::sqrt(piece.size2) / static_cast<double>(pieces.size());
    const OrientedPlaces places(surface, crossings, kTurnLength * size);
    if (places.empty()) return false;
    std::vector<Pull> pulls(pieces.size());
    double least = std::numeric_limits<double>::infinity();
    for (int step = 0; step < kMostStepsFromAfar; ++step) {
        const Pull sum = pull_all(pulls, [&](std::size_t k) {
            const double reach = kReach * (pieces[k].beside.empty() ? std::sqrt(pieces[k].size2) : size);
            Pull pull = pull_from_afar(pieces[k], particles, reach, places);
            resting.hold(k, pieces[k], pull);
            return pull;
        });
        const double off = std::sqrt(sum.off2 / sum.samples);
        const bool stiffer = step < static_cast<int>(kStiffnessFromAfar.size());
        if (!stiffer && !(off < kCloser * least)) break;
        least = off;
        const double stiffness = stiffer ? kStiffnessFromAfar[step] : kStiffnessFromAfar.back();
        if (!step_on(pieces, pulls, surface.resolution(), stiffness, solver)) return false;
    }
    return true;
}

}  // namespace

std::optional<std::vector<Vec3>> register_to(const Surface& surface, const CrossingGrid& crossings,
                                             const Particles& particles, const Adjacency& ring,
                                             const std::vector<Vec3>& guess) {
    const double resolution = surface.resolution();
    std::vector<Piece> pieces = make_pieces(ring, particles.position);
    parallel_for_each(pieces.size(), 16,
                      [&](std::size_t k) { move_as(particles.position, guess, pieces[k]); });
    ThreadProbes probes(surface);
    std::vector<Pull> pulls(pieces.size());
    Solver solver;
    Resting resting;
    std::vector<Piece> best;
    double robust = 2.0 * resolution, stiffness = kStiffness, least = std::numeric_limits<double>::infinity();
    for (int step = 0; step <= kMostSteps; ++step) {
        const Pull sum = pull_all(pulls, [&](std::size_t k) {
            Pull pull = pull_of(pieces[k], particles, robust, resolution, probes.local());
            resting.hold(k, pieces[k], pull);
            return pull;
        });
        const double off = std::sqrt(sum.off2 / sum.samples);
        if (!(off < least)) break;
        const bool is_enough = !(off > kArrived * resolution && off < kBetter * least);
        if (step == 0 && is_enough) break;  // as it is
        least = off;
        if (step > 0) best = pieces;
        if (is_enough) break;
        robust = std::max(resolution, 2.0 * off);
        if (step == 0 && sum.unseen > kUnseen * sum.samples) {
            resting.take(pieces, pulls, resolution);
            std::vector<Piece> come = pieces;
            if (come_from_afar(come, resting, surface, crossings, particles, solver)) {
                pieces = std::move(come);
                stiffness = kStiffnessAfterwards;
                continue;
            }
        }
        if (!step_on(pieces, pulls, resolution, stiffness, solver)) break;
    }
    if (best.empty()) return std::nullopt;
    return blended(best, particles.position);
}

}  // namespace isotrack
