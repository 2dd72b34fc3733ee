#include "io/vdb_tree_walk.h"

#include <gtest/gtest.h>
#include <openvdb/io/io.h>
#include <openvdb/tools/LevelSetSphere.h>

#include <cstdint>
#include <cstring>
#include <sstream>
#include <stdexcept>
#include <string>

namespace isotrack {
namespace {

constexpr VdbValueLayout kFloats{sizeof(float), sizeof(float), false, openvdb::io::COMPRESS_NONE};

/// A tree of floats as OpenVDB writes it, without compression, and where the buffers of its leaves begin.
struct Tree {
    std::string bytes;
    std::size_t topology = 0, leaves = 0;

    Tree() {
        const auto sphere =
            openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(60.f, openvdb::Vec3f(3.f), 1.f);
        std::ostringstream out;
        openvdb::io::setDataCompression(out, kFloats.compression);
        sphere->writeTopology(out);
        topology = static_cast<std::size_t>(out.tellp());
        sphere->writeBuffers(out);
        bytes = out.str();
        leaves = sphere->tree().leafCount();
    }
};

/// Gives the bytes one after the other.
VdbTreeWalk::Read reader_of(const std::string& bytes) {
    return [&bytes, at = std::size_t{0}](char* to, std::size_t count) mutable {
        ASSERT_LE(count, bytes.size() - at);
        std::memcpy(to, bytes.data() + at, count);
        at += count;
    };
}

TEST(VdbTreeWalk, GivesTheWholeTreeInPartsThatAreNotLarge) {
    const Tree tree;
    const std::string with_more = tree.bytes + std::string(1'000'000, 'x');  // which is not the tree's
    VdbTreeWalk walk(with_more.size(), kFloats, reader_of(with_more));
    std::string all(walk.topology());
    EXPECT_EQ(all.size(), tree.topology);
    ASSERT_EQ(walk.leaf_count(), tree.leaves);
    std::size_t leaves = 0, parts = 0;
    for (;; ++parts) {
        const VdbTreeWalk::Buffers buffers = walk.next_buffers();
        if (buffers.begin.empty()) break;
        EXPECT_EQ(buffers.begin.front(), 0u);
        EXPECT_LT(buffers.bytes.size(), 200'000u);
        leaves += buffers.begin.size();
        all += buffers.bytes;
        EXPECT_EQ(walk.position(), all.size());
    }
    EXPECT_GT(parts, 4u);
    EXPECT_EQ(leaves, tree.leaves);
    EXPECT_EQ(all, tree.bytes);
}

TEST(VdbTreeWalk, RefusesWhatEndsTooEarly) {
    const Tree tree;
    const auto walk_all = [&](std::size_t size) {
        VdbTreeWalk walk(size, kFloats, reader_of(tree.bytes));
        walk.topology();
        while (!walk.next_buffers().begin.empty()) continue;
    };
    EXPECT_NO_THROW(walk_all(tree.bytes.size()));
    for (const std::size_t size : {std::size_t{0}, std::size_t{3}, tree.topology - 1, tree.topology,
                                   tree.topology + tree.leaves * 65 - 1, tree.bytes.size() - 1})
        EXPECT_THROW(walk_all(size), std::runtime_error) << size;
    // More leaves than there can be buffers are refused before there is memory for them.
    VdbTreeWalk walk(tree.topology + tree.leaves * 65 - 1, kFloats, reader_of(tree.bytes));
    EXPECT_THROW(walk.topology(), std::runtime_error);
}

TEST(VdbTreeWalk, PassesOnWhatReadingThrows) {
    const Tree tree;
    struct GoneError {};
    std::size_t left = tree.bytes.size() / 2;
    const auto read = reader_of(tree.bytes);
    VdbTreeWalk walk(tree.bytes.size(), kFloats, [&](char* to, std::size_t count) {
        if (count > left) throw GoneError();
        left -= count;
        read(to, count);
    });
    walk.topology();
    EXPECT_THROW(while (!walk.next_buffers().begin.empty()) continue, GoneError);
}

TEST(VdbTreeWalk, RefusesABlockThatSaysItIsLargerPackedThanNot) {
    const VdbValueLayout zipped{sizeof(float), sizeof(float), false, openvdb::io::COMPRESS_ZIP};
    const auto sphere =
        openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(5.f, openvdb::Vec3f(0.f), 1.f);
    std::ostringstream out;
    openvdb::io::setDataCompression(out, zipped.compression);
    sphere->writeTopology(out);
    const auto first_length = static_cast<std::size_t>(out.tellp()) + 64 + 1;  // behind a mask and a kind
    sphere->writeBuffers(out);
    const std::string good = out.str();
    const auto walk_all = [&](const std::string& bytes) {
        VdbTreeWalk walk(bytes.size(), zipped, reader_of(bytes));
        walk.topology();
        while (!walk.next_buffers().begin.empty()) continue;
    };
    EXPECT_NO_THROW(walk_all(good));
    std::string bad = good + std::string(1'000'000, 'x');  // so that it does not end too early
    const std::int64_t length = 900'000;
    std::memcpy(&bad[first_length], &length, sizeof(length));
    try {
        walk_all(bad);
        ADD_FAILURE() << "was not refused";
    } catch (const std::runtime_error& error) {
        EXPECT_STREQ(error.what(), "a block of its voxels has a wrong length");
    }
}

}  // namespace
}  // namespace isotrack
