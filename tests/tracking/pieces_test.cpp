// A surface in pieces: that they are all of it, and move as they should.
#include "tracking/pieces.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "isotrack/surface/shapes.h"
#include "support/ringed_samples.h"

namespace isotrack {
namespace {

struct Sampled : support::RingedSamples {
    std::vector<Piece> pieces;

    Sampled(const shapes::SurfacePtr& surface, double edge)
        : RingedSamples(surface, edge), pieces(make_pieces(ring, particles.position)) {}
};

/// One with some pieces, and a drop that is one of its own.
Sampled torus_and_drop() {
    return Sampled(
        shapes::unite({shapes::torus({0, 0, 0}, 0.8, 0.25, 0.05), shapes::sphere({0, 0, 0}, 0.15, 0.05)}),
        0.1);
}

TEST(Pieces, HoldEachParticleOnce) {
    const Sampled sampled = torus_and_drop();
    const auto& pieces = sampled.pieces;
    ASSERT_GT(pieces.size(), 5u);
    std::vector<int> in(sampled.particles.size(), 0);
    std::size_t alone = 0;
    for (std::size_t k = 0; k < pieces.size(); ++k) {
        for (const int i : pieces[k].particles) ++in[i];
        EXPECT_TRUE(std::is_sorted(pieces[k].beside.begin(), pieces[k].beside.end()));
        for (const int l : pieces[k].beside) {
            const auto& back = pieces[l].beside;
            EXPECT_NE(l, static_cast<int>(k));
            EXPECT_TRUE(std::binary_search(back.begin(), back.end(), static_cast<int>(k)));
        }
        EXPECT_LT(pieces[k].particles.size(), 100u);
        alone += pieces[k].beside.empty();
        EXPECT_GE(pieces[k].particles.size(), pieces[k].beside.empty() ? 1u : 12u);
    }
    EXPECT_EQ(std::count(in.begin(), in.end(), 1), static_cast<std::ptrdiff_t>(in.size()));
    EXPECT_EQ(alone, 1u);
}

TEST(Pieces, MoveAsTheirParticlesDo) {
    const Eigen::Isometry3d motion =
        Eigen::Translation3d(0.3, -0.2, 0.1) * Eigen::AngleAxisd(1.2, Vec3(1, 2, 3).normalized());
    Sampled sampled = torus_and_drop();
    const auto& from = sampled.particles.position;
    std::vector<Vec3> to;
    for (const Vec3& p : from) to.push_back(motion * p);
    for (Piece& piece : sampled.pieces) {
        for (const int i : piece.particles)
            EXPECT_LT((piece.moved(from[i]) - from[i]).norm(), 1e-12) << "before it moved";
        move_as(from, to, piece);
        EXPECT_LT((piece.turn - motion.linear()).norm(), 1e-9);
    }
    const std::vector<Vec3> moved = blended(sampled.pieces, from);
    for (std::size_t i = 0; i < from.size(); ++i) EXPECT_LT((moved[i] - to[i]).norm(), 1e-9);
}

TEST(Pieces, KeepTheTurnOfWhatShowsNone) {
    const std::vector<Vec3> line = {{0, 0, 0}, {0.1, 0, 0}, {0.2, 0, 0}};
    std::vector<Vec3> to;
    for (const Vec3& p : line) to.push_back(Eigen::AngleAxisd(0.5, Vec3::UnitX()) * p + Vec3(1, 2, 3));
    for (const std::vector<int>& some : {std::vector<int>{0, 1, 2}, std::vector<int>{1}}) {
        Piece piece;
        piece.particles = some;
        for (const int i : some) piece.middle += line[i] / static_cast<double>(some.size());
        move_as(line, to, piece);
        EXPECT_TRUE(piece.turn.isIdentity(0.0));
        for (const int i : some) EXPECT_LT((piece.moved(line[i]) - to[i]).norm(), 1e-12);
    }
}

TEST(Pieces, DoNotBecomeMirrored) {
    const Sampled sampled = torus_and_drop();
    std::vector<Vec3> mirrored = sampled.particles.position;
    for (Vec3& p : mirrored) p.z() = -p.z();
    for (Piece piece : sampled.pieces) {
        move_as(sampled.particles.position, mirrored, piece);
        EXPECT_NEAR(piece.turn.determinant(), 1.0, 1e-9);
        EXPECT_TRUE((piece.turn * piece.turn.transpose()).isIdentity(1e-9));
    }
}

}  // namespace
}  // namespace isotrack
