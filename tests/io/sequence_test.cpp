#include "isotrack/io/sequence.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "isotrack/error.h"
#include "support/temp_folder.h"

namespace isotrack {
namespace {

namespace fs = std::filesystem;

class Sequence : public testing::Test {
protected:
    void touch(const std::string& name) {
        fs::create_directories((folder_ / name).parent_path());
        std::ofstream(folder_ / name) << "x";
    }
    std::string path(const std::string& name) const { return (folder_ / name).string(); }

    static std::vector<int> numbers(const InputSequence& sequence) {
        std::vector<int> result;
        for (const InputFrame& frame : sequence.frames) result.push_back(frame.number);
        return result;
    }
    static std::string name(const InputFrame& frame) { return fs::path(frame.path).filename().string(); }

    /// The message of the refusal: one line that says something.
    static std::string refusal(const std::vector<std::string>& inputs,
                               const std::optional<FrameRange>& range = {}) {
        try {
            find_frames(inputs, range);
        } catch (const OptionError& error) {
            EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
            return error.what();
        }
        ADD_FAILURE() << "was not refused";
        return {};
    }

    support::TempFolder temp_;
    fs::path folder_ = temp_.path();
};

using Numbers = std::vector<int>;

TEST_F(Sequence, FindsEveryFormOfPattern) {
    for (const char* file :
         {"a.0001.vdb", "a.0002.vdb", "a.0010.vdb", "a.10000.vdb", "b.0001.vdb", "a.0003.txt"})
        touch(file);
    for (const char* pattern : {"a.####.vdb", "a.%04d.vdb", "a.%d.vdb", "a.{}.vdb", "a.#.vdb"})
        EXPECT_EQ(numbers(find_frames({path(pattern)}, FrameRange{1, 10000})), (Numbers{1, 2, 10, 10000}))
            << pattern;
}

TEST_F(Sequence, NeedsAtLeastAsManyDigitsAsThePatternPads) {
    for (const char* file : {"a1.vdb", "a02.vdb", "a0003.vdb", "a.vdb", "a4x.vdb"}) touch(file);
    EXPECT_EQ(numbers(find_frames({path("a##.vdb")})), (Numbers{2, 3}));
    EXPECT_EQ(numbers(find_frames({path("a%04d.vdb")})), (Numbers{3}));
    EXPECT_EQ(numbers(find_frames({path("a{}.vdb")})), (Numbers{1, 2, 3}));
}

TEST_F(Sequence, TakesEveryVdbOfAFolderAndNothingElse) {
    for (const char* file : {"f_9.vdb", "f_10.VDB", "f_11.txt", "._f_9.vdb", "inner/f_12.vdb"}) touch(file);
    fs::create_directory(folder_ / "f_13.vdb");
    EXPECT_EQ(numbers(find_frames({folder_.string()})), (Numbers{9, 10}));
}

TEST_F(Sequence, PutsAListInNaturalOrderAndNumbersNamesWithoutDigitsByPlace) {
    for (const char* file : {"b.vdb", "a.vdb", "c.vdb"}) touch(file);
    const InputSequence sequence = find_frames({path("c.vdb"), path("a.vdb"), path("b.vdb")});
    EXPECT_EQ(numbers(sequence), (Numbers{0, 1, 2}));
    EXPECT_EQ(name(sequence.frames[0]), "a.vdb");
    EXPECT_EQ(name(sequence.frames[2]), "c.vdb");
}

TEST_F(Sequence, ReadsTheLastDigitsOfTheStem) {
    for (const char* file : {"run2_v07_0042.vdb", "0007.vdb", "sim.0008.vdb", "x3_end.vdb"}) touch(file);
    EXPECT_EQ(find_frames({path("run2_v07_0042.vdb")}).frames[0].number, 42);
    EXPECT_EQ(find_frames({path("0007.vdb")}).frames[0].number, 7);
    EXPECT_EQ(find_frames({path("sim.0008.vdb")}).frames[0].number, 8);
    EXPECT_EQ(find_frames({path("x3_end.vdb")}).frames[0].number, 3);
}

TEST_F(Sequence, TakesASingleFileWithoutANumberOrWithOneTooLong) {
    touch("sphere.vdb");
    touch("sphere_20240131235959.vdb");
    EXPECT_EQ(numbers(find_frames({path("sphere.vdb")})), (Numbers{0}));
    EXPECT_EQ(numbers(find_frames({path("sphere_20240131235959.vdb")})), (Numbers{0}));
}

TEST_F(Sequence, TakesAnExistingFileWhoseNameLooksLikeAPattern) {
    touch("take#3.vdb");
    EXPECT_EQ(find_frames({path("take#3.vdb")}).frames[0].path, path("take#3.vdb"));
}

TEST_F(Sequence, OrdersByNumberWhateverThePadding) {
    for (const char* file : {"f10.vdb", "f9.vdb", "f008.vdb"}) touch(file);
    const InputSequence sequence = find_frames({folder_.string()});
    EXPECT_EQ(numbers(sequence), (Numbers{8, 9, 10}));
    EXPECT_EQ(name(sequence.frames[0]), "f008.vdb");
}

TEST_F(Sequence, ListsGaps) {
    for (const char* file : {"f1.vdb", "f2.vdb", "f5.vdb", "f7.vdb"}) touch(file);
    EXPECT_EQ(find_frames({folder_.string()}).missing, (Numbers{3, 4, 6}));
    EXPECT_EQ(find_frames({folder_.string()}, FrameRange{1, 7, 2}).missing, (Numbers{3}));
    // The ends of a range are asked for by name, so they are missed too.
    EXPECT_EQ(find_frames({folder_.string()}, FrameRange{-3, 9, 4}).missing, (Numbers{-3, 9}));
}

TEST_F(Sequence, KeepsTheFramesOfARangeBothEndsIncluded) {
    for (int i = 1; i <= 9; ++i) touch("f" + std::to_string(i) + ".vdb");
    EXPECT_EQ(numbers(find_frames({folder_.string()}, FrameRange{3, 5})), (Numbers{3, 4, 5}));
    EXPECT_EQ(numbers(find_frames({folder_.string()}, FrameRange{2, 9, 3})), (Numbers{2, 5, 8}));
}

TEST_F(Sequence, CountsAFileNamedTwiceOnce) {
    touch("f1.vdb");
    EXPECT_EQ(numbers(find_frames({path("f1.vdb"), path("f1.vdb"), folder_.string(), path("f#.vdb")})),
              (Numbers{1}));
}

TEST_F(Sequence, RefusesTwoFilesOfOneNumber) {
    touch("a/f_0001.vdb");
    touch("b/f_0001.vdb");
    const std::string message = refusal({path("a/f_0001.vdb"), path("b/f_0001.vdb")});
    EXPECT_NE(message.find(path("a/f_0001.vdb")), std::string::npos);
    EXPECT_NE(message.find(path("b/f_0001.vdb")), std::string::npos);

    touch("c/f1.vdb");
    touch("c/f01.vdb");
    EXPECT_NE(refusal({path("c/f{}.vdb")}).find("frame 1"), std::string::npos);
}

TEST_F(Sequence, RefusesWhatMatchesNothing) {
    touch("f1.txt");
    refusal({});
    EXPECT_NE(refusal({path("nothing.vdb")}).find("nothing.vdb"), std::string::npos);
    EXPECT_NE(refusal({folder_.string()}).find("no .vdb"), std::string::npos);
    EXPECT_NE(refusal({path("f####.vdb")}).find("f####.vdb"), std::string::npos);
    EXPECT_NE(refusal({path("nowhere/f#.vdb")}).find("nowhere"), std::string::npos);
    touch("f1.vdb");
    EXPECT_NE(refusal({folder_.string()}, FrameRange{2, 5}).find("2:5"), std::string::npos);
}

TEST_F(Sequence, RefusesTwoFieldsAndAFieldInTheFolder) {
    EXPECT_NE(refusal({path("f_##_%d.vdb")}).find("two fields"), std::string::npos);
    EXPECT_NE(refusal({path("run_####/f.vdb")}).find("folder"), std::string::npos);
    EXPECT_THROW(has_frame_field("a_#_#.ply"), OptionError);
}

TEST_F(Sequence, RefusesNumbersThatCannotBeOneSequence) {
    touch("a3.vdb");
    touch("a20240131.vdb");
    EXPECT_NE(refusal({folder_.string()}).find("20240131"), std::string::npos);
    EXPECT_EQ(numbers(find_frames({folder_.string()}, FrameRange{3, 3})), (Numbers{3}));
}

TEST(FrameRange, ReadsAllThreeForms) {
    EXPECT_EQ(parse_frame_range("7").first, 7);
    EXPECT_EQ(parse_frame_range("7").last, 7);
    EXPECT_EQ(parse_frame_range("3:9").last, 9);
    EXPECT_EQ(parse_frame_range("3:9").step, 1);
    EXPECT_EQ(parse_frame_range("3:9:2").step, 2);
}

TEST(FrameRange, RefusesTheRest) {
    for (const char* text : {"", ":", "1:", ":2", "1:2:", "1:2:3:4", "1-5", "a:b", "5:1", "1:5:0", "1:5:-1",
                             "1.5", "99999999999", " 1", "1:5 "})
        EXPECT_THROW(parse_frame_range(text), OptionError) << "'" << text << "'";
}

TEST(Pattern, PadsToAtLeastTheWidth) {
    EXPECT_EQ(expand_pattern("o/m.####.ply", 7), "o/m.0007.ply");
    EXPECT_EQ(expand_pattern("m.##.ply", 12345), "m.12345.ply");
    EXPECT_EQ(expand_pattern("m%04d.ply", 7), "m0007.ply");
    EXPECT_EQ(expand_pattern("m%d.ply", 7), "m7.ply");
    EXPECT_EQ(expand_pattern("m{}.ply", 7), "m7.ply");
    EXPECT_EQ(expand_pattern("m_%03d.ply", -7), "m_-007.ply");
    EXPECT_EQ(expand_pattern("plain.ply", 7), "plain.ply");
}

TEST(Pattern, KnowsAField) {
    EXPECT_TRUE(has_frame_field("a#.ply"));
    EXPECT_TRUE(has_frame_field("a%05d.ply"));
    EXPECT_TRUE(has_frame_field("{}.ply"));
    EXPECT_FALSE(has_frame_field("a.ply"));
    EXPECT_FALSE(has_frame_field("100%.ply"));
    EXPECT_FALSE(has_frame_field("{0}.ply"));
}

}  // namespace
}  // namespace isotrack
