#include "tracking/pieces.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <utility>

#include "parallel_for_each.h"

namespace isotrack {
namespace {

constexpr std::size_t kPieceSize = 48,
                      kMostPieces = 160;  // about; more of them where there are more components
constexpr double kSpread =
    1e-6;  // squares, across a piece over along it: less is a line, whose turn is not known
constexpr double kLeastWeight = 1e-9;  // of a particle's own piece

}  // namespace

std::vector<Piece> make_pieces(const Adjacency& ring, const std::vector<Vec3>& at) {
    const std::size_t n = at.size(), size = std::max(kPieceSize, n / kMostPieces);
    std::vector<int> piece_of(n, -1);
    std::vector<Piece> pieces;
    std::vector<int> some;
    for (std::size_t first = 0; first < n; ++first) {
        if (piece_of[first] >= 0) continue;
        const int number = static_cast<int>(pieces.size());
        some.assign(1, static_cast<int>(first));
        piece_of[first] = number;
        int neighbour = -1;
        for (std::size_t next = 0; next < some.size(); ++next)
            for (const int j : ring.of(some[next])) {
                if (piece_of[j] >= 0 && piece_of[j] != number) neighbour = piece_of[j];
                if (piece_of[j] >= 0 || some.size() >= size) continue;
                piece_of[j] = number;
                some.push_back(j);
            }
        if (neighbour >= 0 && some.size() < size / 4) {  // what was left between others
            for (const int i : some) piece_of[i] = neighbour;
            auto& of_neighbour = pieces[neighbour].particles;
            of_neighbour.insert(of_neighbour.end(), some.begin(), some.end());
        } else {
            pieces.emplace_back().particles = some;
        }
    }
    std::vector<int> beside;
    for (std::size_t k = 0; k < pieces.size(); ++k) {
        Piece& piece = pieces[k];
        beside.clear();
        for (const int i : piece.particles) {
            piece.middle += at[i] / static_cast<double>(piece.particles.size());
            for (const int j : ring.of(i))
                if (piece_of[j] != static_cast<int>(k)) beside.push_back(piece_of[j]);
        }
        for (const int i : piece.particles)
            piece.size2 += (at[i] - piece.middle).squaredNorm() / static_cast<double>(piece.particles.size());
        std::sort(beside.begin(), beside.end());
        piece.beside.assign(beside.begin(), std::unique(beside.begin(), beside.end()));
    }
    return pieces;
}

void move_as(const std::vector<Vec3>& from, const std::vector<Vec3>& to, Piece& piece) {
    Vec3 middle = Vec3::Zero();
    for (const int i : piece.particles) middle += to[i] / static_cast<double>(piece.particles.size());
    Mat3 spread = Mat3::Zero();
    for (const int i : piece.particles) spread += (to[i] - middle) * (from[i] - piece.middle).transpose();
    const Eigen::JacobiSVD<Mat3> svd(spread, Eigen::ComputeFullU | Eigen::ComputeFullV);
    piece.shift = middle - piece.middle;
    Mat3 mirror = Mat3::Identity();
    if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0) mirror(2, 2) = -1.0;
    if (svd.singularValues()[1] > kSpread * svd.singularValues()[0])
        piece.turn = svd.matrixU() * mirror * svd.matrixV().transpose();
}

std::vector<Vec3> blended(const std::vector<Piece>& pieces, const std::vector<Vec3>& from) {
    std::vector<Vec3> result(from.size());
    parallel_for_each(pieces.size(), 4, [&](std::size_t k) {
        const Piece& piece = pieces[k];
        double width2 = 0.0;
        for (const int l : piece.beside)
            width2 +=
                (pieces[l].middle - piece.middle).squaredNorm() / static_cast<double>(piece.beside.size());
        for (const int i : piece.particles) {
            result[i] = piece.moved(from[i]);
            if (!(width2 > 0.0)) continue;
            const auto weight_of = [&](const Piece& of) {
                return std::exp(-2.0 * (from[i] - of.middle).squaredNorm() / width2);
            };
            double weights = kLeastWeight + weight_of(piece);
            Vec3 sum = weights * result[i];
            for (const int l : piece.beside) {
                const double w = weight_of(pieces[l]);
                sum += w * pieces[l].moved(from[i]);
                weights += w;
            }
            result[i] = sum / weights;
        }
    });
    return result;
}

}  // namespace isotrack
