#include "isotrack/io/vdb_file.h"

#include <gtest/gtest.h>
#include <openvdb/io/Stream.h>
#include <openvdb/tools/LevelSetSphere.h>
#include <sys/resource.h>
#ifdef __SANITIZE_ADDRESS__
#include <sanitizer/lsan_interface.h>
#endif

#include <algorithm>
#include <cstring>
#include <fstream>
#include <functional>
#include <sstream>

#include "isotrack/error.h"
#include "support/temp_folder.h"

namespace isotrack {
namespace {

namespace fs = std::filesystem;

std::string read_bytes(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

void write_bytes(const std::string& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary) << bytes;
}

openvdb::FloatGrid::Ptr small_sphere(const std::string& name, float voxel = 0.5f) {
    const auto grid =
        openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(2 * voxel, openvdb::Vec3f(0.f), voxel);
    grid->setName(name);
    return grid;
}

void write_vdb(const std::string& path, const openvdb::GridCPtrVec& grids, std::uint32_t compression = 0) {
    openvdb::io::File file(path);
    file.setCompression(compression);
    file.write(grids);
}

/// The refusal: one line, short, printable, naming the file.
std::string refusal(const std::string& path, const std::function<void()>& work) {
    try {
        work();
    } catch (const Error& error) {
        const std::string message = error.what();
        EXPECT_LE(message.size(), 300u);
        for (const char c : message) EXPECT_GE(static_cast<unsigned char>(c), 0x20) << message;
        EXPECT_NE(message.find(fs::path(path).filename().string()), std::string::npos) << message;
        return message;
    }
    ADD_FAILURE() << "was not refused: " << path;
    return {};
}

std::string check_refusal(const std::string& path) {
    return refusal(path, [&] { check_vdb_file(path); });
}

/// Everything a run does with a file. True when all went well; anything but an `IoError` on the way fails the
/// test.
bool opens(const std::string& path) {
    bool good = true;
    try {
        check_vdb_file(path);
        for (const GridInfo& grid : list_grids(path)) {
            try {
                read_grid(path, grid);
            } catch (const IoError&) {
                good = false;
            }
        }
    } catch (const IoError&) {
        good = false;
    }
    return good;
}

/// Always 0 with the address sanitizer, which keeps freed memory back.
double peak_megabytes() {
#ifdef __SANITIZE_ADDRESS__
    return 0.0;
#endif
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

/// Bytes of a VDB file put together by hand.
class Bytes {
public:
    template <typename T>
    Bytes& add(T value) {
        text_.append(reinterpret_cast<const char*>(&value), sizeof(value));
        return *this;
    }
    Bytes& raw(const std::string& text) {
        text_ += text;
        return *this;
    }
    Bytes& string(const std::string& text) { return add(static_cast<std::uint32_t>(text.size())).raw(text); }
    Bytes& header(std::uint32_t version = 224) {
        return add(std::int64_t{0x56444220})
            .add(version)
            .add(10u)
            .add(0u)
            .add(char{1})
            .raw(std::string(36, '0'));
    }
    const std::string& str() const { return text_; }

private:
    std::string text_;
};

class VdbFileTest : public testing::Test {
protected:
    std::string file(const std::string& name = "f.vdb") const { return temp_.file(name); }
    std::string with(const std::string& bytes) const {
        write_bytes(file(), bytes);
        return file();
    }
    support::TempFolder temp_;
};

TEST_F(VdbFileTest, SaysWhatOpenVdbWrote) {
    auto sphere = small_sphere("phi", 0.25f);
    sphere->setSaveFloatAsHalf(true);
    auto fog = openvdb::DoubleGrid::create(0.0);
    fog->setName("density");
    fog->setGridClass(openvdb::GRID_FOG_VOLUME);
    fog->tree().setValue({1, 2, 3}, 0.5);
    fog->setTransform(
        std::make_shared<openvdb::math::Transform>(std::make_shared<openvdb::math::ScaleTranslateMap>(
            openvdb::Vec3d(1, 2, 4), openvdb::Vec3d(5, 6, 7))));
    auto velocity = openvdb::Vec3SGrid::create();
    velocity->setName("vel");
    velocity->setGridClass(openvdb::GRID_STAGGERED);
    write_vdb(file(), {sphere, fog, velocity});

    const std::vector<GridInfo> grids = list_grids(file());
    ASSERT_EQ(grids.size(), 3u);
    EXPECT_EQ(grids[0].label, "phi");
    EXPECT_EQ(grids[0].type, "float");
    EXPECT_EQ(grids[0].grid_class, "level set");
    EXPECT_TRUE(grids[0].half);
    EXPECT_EQ(grids[0].active_voxels, sphere->activeVoxelCount());
    EXPECT_EQ(grids[0].transform, "uniform");
    EXPECT_NEAR(grids[0].voxel_size, 0.25, 1e-12);
    EXPECT_EQ(grids[1].name, "density");
    EXPECT_EQ(grids[1].type, "double");
    EXPECT_EQ(grids[1].grid_class, "fog volume");
    EXPECT_FALSE(grids[1].half);
    EXPECT_EQ(grids[1].transform, "scale");
    EXPECT_NEAR(grids[1].voxel_size, 2.0, 1e-12);
    EXPECT_EQ(grids[2].type, "vec3s");
    EXPECT_EQ(grids[2].grid_class, "staggered");
}

TEST_F(VdbFileTest, ReadsWhatOpenVdbReads) {
    for (const std::uint32_t compression :
         {std::uint32_t{openvdb::io::COMPRESS_NONE}, std::uint32_t{openvdb::io::COMPRESS_ZIP},
          std::uint32_t{openvdb::io::COMPRESS_ACTIVE_MASK},
          std::uint32_t{openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK}})
        for (const bool half : {false, true}) {
            auto sphere = small_sphere("phi");
            sphere->setSaveFloatAsHalf(half);
            sphere->insertMeta("note", openvdb::StringMetadata("kept"));
            auto points = openvdb::Vec3DGrid::create();
            points->setName("other");
            points->tree().setValue({3, 4, 5}, {1, 2, 3});
            write_vdb(file(), {points, sphere}, compression);

            openvdb::io::File reference_file(file());
            reference_file.open(false);
            const auto reference = openvdb::gridPtrCast<openvdb::FloatGrid>(reference_file.readGrid("phi"));
            const auto grid =
                openvdb::gridPtrCast<openvdb::FloatGrid>(read_grid(file(), list_grids(file())[1]));
            ASSERT_TRUE(grid);
            EXPECT_TRUE(grid->tree().hasSameTopology(reference->tree()));
            for (auto value = reference->cbeginValueAll(); value; ++value)
                ASSERT_EQ(grid->tree().getValue(value.getCoord()), *value);
            EXPECT_EQ(grid->background(), reference->background());
            EXPECT_EQ(grid->transform(), reference->transform());
            EXPECT_EQ(grid->getGridClass(), openvdb::GRID_LEVEL_SET);
            EXPECT_EQ(grid->getName(), "phi");
            EXPECT_EQ(grid->saveFloatAsHalf(), half);
            EXPECT_EQ(grid->metaValue<std::string>("note"), "kept");
        }
}

template <typename Grid>
void expect_same_values(const Grid& grid, const Grid& reference) {
    ASSERT_TRUE(grid.tree().hasSameTopology(reference.tree()));
    EXPECT_EQ(grid.background(), reference.background());
    auto value = grid.cbeginValueAll();
    for (auto there = reference.cbeginValueAll(); there; ++there, ++value) ASSERT_EQ(*value, *there);
}

/// Of a grid read here and by OpenVDB.
template <typename Grid>
void expect_as_openvdb_reads(const std::string& path, const GridInfo& info) {
    openvdb::io::File file(path);
    file.open(false);
    const auto reference = openvdb::gridPtrCast<Grid>(file.readGrid(info.name));
    const auto grid = openvdb::gridPtrCast<Grid>(read_grid(path, info));
    ASSERT_TRUE(grid);
    expect_same_values(*grid, *reference);
}

TEST_F(VdbFileTest, ReadsManyLeavesAsOpenVdbDoes) {
    constexpr std::size_t kManyLeaves = 1000;  // of which each thread reads some
    const auto sphere =
        openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(60.f, openvdb::Vec3f(3.f), 1.f);
    ASSERT_GT(sphere->tree().leafCount(), kManyLeaves);
    ASSERT_EQ(sphere->tree().root().childCount(), 8u);
    sphere->setName("phi");
    const auto doubled = openvdb::DoubleGrid::create(3.0);
    const auto velocity = openvdb::Vec3SGrid::create(openvdb::Vec3s(1.f, 2.f, 3.f));
    const auto precise = openvdb::Vec3DGrid::create(openvdb::Vec3d(4.0, 5.0, 6.0));
    for (auto value = sphere->cbeginValueOn(); value; ++value) {
        const openvdb::Coord at = value.getCoord();
        doubled->tree().setValue(at, 2.0 * *value);
        velocity->tree().setValue(at, openvdb::Vec3s(*value, static_cast<float>(at.x()), 1.f));
        precise->tree().setValue(at, openvdb::Vec3d(*value, 1.0 / 3.0, at.z()));
    }
    doubled->setName("doubled");
    velocity->setName("velocity");
    precise->setName("precise");
    for (const std::uint32_t compression :
         {std::uint32_t{openvdb::io::COMPRESS_NONE},
          std::uint32_t{openvdb::io::COMPRESS_ZIP | openvdb::io::COMPRESS_ACTIVE_MASK},
          std::uint32_t{openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK}})
        for (const bool half : {false, true}) {
            const std::vector<openvdb::GridBase::Ptr> written = {doubled, sphere, velocity, precise};
            for (const auto& grid : written) grid->setSaveFloatAsHalf(half);
            write_vdb(file(), {written.begin(), written.end()}, compression);
            const std::vector<GridInfo> grids = list_grids(file());
            expect_as_openvdb_reads<openvdb::DoubleGrid>(file(), grids[0]);
            expect_as_openvdb_reads<openvdb::FloatGrid>(file(), grids[1]);
            expect_as_openvdb_reads<openvdb::Vec3SGrid>(file(), grids[2]);
            expect_as_openvdb_reads<openvdb::Vec3DGrid>(file(), grids[3]);
        }
}

constexpr std::size_t kSeveralParts = 1'000'000;  // bytes: more than are read at once

openvdb::FloatGrid::Ptr large_sphere() {
    const auto sphere =
        openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(60.f, openvdb::Vec3f(3.f), 1.f);
    sphere->setName("phi");
    return sphere;
}

TEST_F(VdbFileTest, FindsTheEndOfALargeTreeInAStream) {
    const auto first = large_sphere();
    const auto second = small_sphere("second");
    std::ofstream out(file(), std::ios::binary);
    openvdb::io::Stream(out).write(openvdb::GridCPtrVec{first, second});
    out.close();
    ASSERT_GT(fs::file_size(file()), kSeveralParts);
    const std::vector<GridInfo> grids = list_grids(file());
    ASSERT_EQ(grids.size(), 2u);
    expect_same_values(*openvdb::gridPtrCast<openvdb::FloatGrid>(read_grid(file(), grids[0])), *first);
    expect_same_values(*openvdb::gridPtrCast<openvdb::FloatGrid>(read_grid(file(), grids[1])), *second);
}

TEST_F(VdbFileTest, RefusesAWrongLengthOfTheLastOfManyBlocks) {
    write_vdb(file(), {large_sphere()}, openvdb::io::COMPRESS_BLOSC);
    std::string bytes = read_bytes(file());
    ASSERT_GT(bytes.size(), kSeveralParts);
    // The length is where it leads to the end.
    std::size_t at = bytes.size() - sizeof(std::int64_t) - 16;
    const auto length_there = [&] {
        std::int64_t length;
        std::memcpy(&length, &bytes[at], sizeof(length));
        return length;
    };
    while (at > bytes.size() - 4096 &&
           length_there() != static_cast<std::int64_t>(bytes.size() - at - sizeof(std::int64_t)))
        --at;
    ASSERT_GT(at, bytes.size() - 4096);
    for (const std::int64_t off : {1, -1}) {
        std::string wrong = bytes;
        const std::int64_t length = length_there() + off;
        std::memcpy(&wrong[at], &length, sizeof(length));
        const std::string path = with(wrong);
        const std::string message = refusal(path, [&] { read_grid(path, list_grids(path)[0]); });
        EXPECT_NE(message.find(off > 0 ? "end too early" : "wrong header"), std::string::npos) << message;
    }
}

TEST_F(VdbFileTest, RefusesADamagedBlockAmongMany) {
    write_vdb(file(), {large_sphere()}, openvdb::io::COMPRESS_BLOSC);
    std::string bytes = read_bytes(file());
    std::fill(bytes.end() - 100, bytes.end(), '\xff');  // in the last block, whose lengths stay
    const std::string path = with(bytes);
    const std::string message = refusal(path, [&] { read_grid(path, list_grids(path)[0]); });
    EXPECT_NE(message.find("decompress"), std::string::npos) << message;  // by the thread that reads it
}

TEST_F(VdbFileTest, KnowsUnnamedGridsAndGridsOfOneName) {
    std::vector<openvdb::FloatGrid::Ptr> grids;
    for (const char* name : {"a", "", "a", "", "b"}) {
        grids.push_back(openvdb::FloatGrid::create(static_cast<float>(grids.size())));
        grids.back()->setName(name);
    }
    write_vdb(file(), {grids.begin(), grids.end()});
    const std::vector<GridInfo> found = list_grids(file());
    ASSERT_EQ(found.size(), 5u);
    const std::vector<std::string> labels{"a[0]", "[0]", "a[1]", "[1]", "b"};
    for (std::size_t i = 0; i < labels.size(); ++i) {
        EXPECT_EQ(found[i].label, labels[i]);
        const auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(read_grid(file(), found[i]));
        EXPECT_EQ(grid->background(), static_cast<float>(i));
        EXPECT_EQ(choose_grid(found, labels[i], file()).label, labels[i]);
    }
    EXPECT_EQ(choose_grid(found, "b[0]", file()).label, "b");
    EXPECT_NE(refusal(file(), [&] { choose_grid(found, "a", file()); }).find("a[0]"), std::string::npos);
    EXPECT_NE(refusal(file(), [&] { choose_grid(found, "c", file()); }).find("a[1]"), std::string::npos);
}

TEST_F(VdbFileTest, ReadsAGridThatSharesTheTreeOfAnother) {
    auto sphere = small_sphere("first");
    auto twin = sphere->copy();  // shallow
    twin->setName("second");
    twin->setTransform(openvdb::math::Transform::createLinearTransform(2.0));
    write_vdb(file(), {sphere, twin});
    const auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(read_grid(file(), list_grids(file())[1]));
    expect_same_values(*grid, *sphere);
    EXPECT_EQ(grid->voxelSize()[0], 2.0);
}

TEST_F(VdbFileTest, ReadsFilesWrittenAsAStream) {
    auto first = small_sphere("first");
    auto second = small_sphere("second", 0.25f);
    std::ofstream out(file(), std::ios::binary);
    openvdb::io::Stream(out).write(openvdb::GridCPtrVec{first, second});
    out.close();
    const std::vector<GridInfo> grids = list_grids(file());
    ASSERT_EQ(grids.size(), 2u);
    EXPECT_EQ(grids[1].label, "second");
    EXPECT_NEAR(grids[1].voxel_size, 0.25, 1e-7);
    const auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(read_grid(file(), grids[1]));
    expect_same_values(*grid, *second);
}

TEST_F(VdbFileTest, KeepsItsGridWhenTheFileIsReplaced) {
    auto sphere = small_sphere("phi");
    write_vdb(file(), {sphere});
    const auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(read_grid(file(), list_grids(file())[0]));
    write_bytes(file(), "gone");
    for (auto value = sphere->cbeginValueOn(); value; ++value)
        ASSERT_EQ(grid->tree().getValue(value.getCoord()), *value);
}

TEST_F(VdbFileTest, ListsTheGoodGridsBesideOneThatCannotBeRead) {
    auto sphere = small_sphere("phi");
    auto other = openvdb::Vec3SGrid::create();
    other->setName("other");
    write_vdb(file(), {other, sphere});
    std::string bytes = read_bytes(file());
    bytes.replace(bytes.find("Tree_vec3s"), 10, "Tree_vec3q");
    const std::vector<GridInfo> grids = list_grids(with(bytes));
    ASSERT_EQ(grids.size(), 2u);
    EXPECT_EQ(grids[0].type, "vec3q");
    EXPECT_TRUE(read_grid(file(), grids[1]));
    EXPECT_NE(refusal(file(), [&] { read_grid(file(), grids[0]); }).find("vec3q"), std::string::npos);
}

TEST_F(VdbFileTest, ListsAGridWhoseTransformIsNotUnderstood) {
    write_vdb(file(), {small_sphere("phi")});
    std::string bytes = read_bytes(file());
    bytes.replace(bytes.find("UniformScaleMap"), 15, "UniformScaleMop");
    const std::vector<GridInfo> grids = list_grids(with(bytes));
    ASSERT_EQ(grids.size(), 1u);
    EXPECT_EQ(grids[0].transform, "");
    EXPECT_EQ(grids[0].voxel_size, 0.0);
    EXPECT_NE(refusal(file(), [&] { read_grid(file(), grids[0]); }).find("UniformScaleMop"),
              std::string::npos);
}

TEST_F(VdbFileTest, ReadsANewerFileVersionWithoutAWord) {
    write_vdb(file(), {small_sphere("phi")});
    std::string bytes = read_bytes(file());
    bytes[8] = static_cast<char>(225);
    with(bytes);
    testing::internal::CaptureStderr();
    testing::internal::CaptureStdout();
    const bool good = opens(file());
    EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
    EXPECT_TRUE(good);
}

TEST_F(VdbFileTest, RefusesWhatIsNoVdbFile) {
    EXPECT_NE(check_refusal(file("missing.vdb")).find("No such file"), std::string::npos);
    EXPECT_NE(check_refusal(temp_.path().string()).find("folder"), std::string::npos);
    EXPECT_NE(check_refusal(with("")).find("empty"), std::string::npos);
    EXPECT_NE(
        check_refusal(with("version https://git-lfs.github.com/spec/v1\noid sha256:0\n")).find("Git LFS"),
        std::string::npos);
    EXPECT_NE(check_refusal(with("\x1f\x8b some")).find("gzip"), std::string::npos);
    EXPECT_NE(check_refusal(with("<html>not found</html>")).find("not a VDB"), std::string::npos);
    EXPECT_NE(check_refusal(with("x")).find("not a VDB"), std::string::npos);
    EXPECT_NE(check_refusal(with(Bytes().header(220).str())).find("220"), std::string::npos);
}

TEST_F(VdbFileTest, TellsACutFileFromADamagedOne) {
    write_vdb(file(), {small_sphere("phi")});
    const std::string bytes = read_bytes(file());
    EXPECT_NE(check_refusal(with(bytes.substr(0, bytes.size() - 1))).find("incomplete copy"),
              std::string::npos);
    EXPECT_NE(check_refusal(with(bytes.substr(0, 60))).find("cut off"), std::string::npos);
}

TEST_F(VdbFileTest, RefusesLengthsBeyondTheFile) {
    constexpr std::uint32_t kHuge = 0xfffffff0u;
    const double before = peak_megabytes();
    const std::vector<std::string> hostile{
        Bytes().header().add(kHuge).str(),                                             // metadata entries
        Bytes().header().add(1u).add(kHuge).str(),                                     // its name
        Bytes().header().add(1u).string("a").add(kHuge).str(),                         // its type
        Bytes().header().add(1u).string("a").string("string").add(kHuge).str(),        // its value
        Bytes().header().add(1u).string("a").string("nobody_knows").add(kHuge).str(),  // its value
        Bytes().header().add(0u).add(0x7fffffff).str(),                                // grids
        Bytes().header().add(0u).add(-5).str(),
        Bytes().header().add(0u).add(1).add(kHuge).str(),              // grid name
        Bytes().header().add(0u).add(1).string("a").add(kHuge).str(),  // grid type
        Bytes().header().add(0u).add(1).string("a").string("Tree_float_5_4_3").add(kHuge).str()};
    for (const std::string& bytes : hostile) check_refusal(with(bytes));

    const auto grid_at = [](std::int64_t begin, std::int64_t end) {
        return Bytes()
            .header()
            .add(0u)
            .add(1)
            .string("a")
            .string("Tree_float_5_4_3")
            .string("")
            .add(begin)
            .add(std::int64_t{0})
            .add(end);
    };
    const auto here = static_cast<std::int64_t>(grid_at(0, 0).str().size());
    check_refusal(with(grid_at(0, 0).str()));
    check_refusal(with(grid_at(-1, here).str()));
    check_refusal(with(grid_at(here, here - 1).str()));
    check_refusal(with(grid_at(here, std::int64_t{1} << 60).str()));
    check_refusal(with(grid_at(here, here + 8).add(0u).add(kHuge).str()));  // metadata of the grid
    // The name of the transform.
    check_refusal(with(grid_at(here, here + 12).add(0u).add(0u).add(kHuge).str()));
    EXPECT_LT(peak_megabytes() - before, 50.0);
}

TEST_F(VdbFileTest, IsNotMisledByMetadata) {
    // A delayed-load entry of many leaves and a float said to be three bytes long: OpenVDB would allocate,
    // and lose its place.
    Bytes metadata;
    metadata.add(3u);
    metadata.string("file_delayed_load").string("__delayedload").add(12u).add(0xfffffff0u).add(0u).add(0u);
    metadata.string("odd").string("float").add(3u).raw("abc");
    metadata.string("class").string("string").string("level set");
    Bytes grid;
    grid.add(0u).raw(metadata.str()).string("UniformScaleMap");
    for (int i = 0; i < 5; ++i) grid.add(0.5).add(0.5).add(0.5);
    grid.add(1u).add(7.0f).add(0u).add(0u);  // one buffer; a root of background 7 without tiles or children
    Bytes bytes;
    bytes.header().raw(metadata.str()).add(1).string("a").string("Tree_float_5_4_3").string("");
    const auto begin = static_cast<std::int64_t>(bytes.str().size()) + 24;
    const std::int64_t end = begin + static_cast<std::int64_t>(grid.str().size());
    bytes.add(begin).add(end).add(end).raw(grid.str());

    const std::vector<GridInfo> grids = list_grids(with(bytes.str()));
    ASSERT_EQ(grids.size(), 1u);
    EXPECT_EQ(grids[0].grid_class, "level set");
    EXPECT_NEAR(grids[0].voxel_size, 0.5, 1e-12);
    const auto read = openvdb::gridPtrCast<openvdb::FloatGrid>(read_grid(file(), grids[0]));
    EXPECT_EQ(read->background(), 7.0f);
    EXPECT_TRUE(read->empty());
}

// One small file for each way of packing voxels.
std::vector<std::string> small_files(const support::TempFolder& temp) {
    std::vector<std::string> files;
    for (const std::uint32_t compression :
         {std::uint32_t{openvdb::io::COMPRESS_ACTIVE_MASK},
          std::uint32_t{openvdb::io::COMPRESS_ZIP | openvdb::io::COMPRESS_ACTIVE_MASK},
          std::uint32_t{openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK}}) {
        auto grid = openvdb::FloatGrid::create(1.0f);
        grid->setName("phi");
        grid->setGridClass(openvdb::GRID_LEVEL_SET);
        grid->setSaveFloatAsHalf(compression == openvdb::io::COMPRESS_ACTIVE_MASK);
        for (int i = 0; i < 20; ++i)
            grid->tree().setValue({i % 5, i % 7, i % 3}, 0.1f * static_cast<float>(i) - 1.0f);
        write_vdb(temp.file("small.vdb"), {grid}, compression);
        files.push_back(read_bytes(temp.file("small.vdb")));
    }
    return files;
}

TEST_F(VdbFileTest, SurvivesACutAtEveryByte) {
    const double before = peak_megabytes();
    for (const std::string& bytes : small_files(temp_)) {
        with(bytes);
        for (std::size_t length = bytes.size(); length-- > 0;) {
            fs::resize_file(file(), length);
            ASSERT_FALSE(opens(file())) << "cut after " << length << " bytes";
        }
    }
    EXPECT_LT(peak_megabytes() - before, 100.0);
}

TEST_F(VdbFileTest, SurvivesDamageAtEveryByte) {
#ifdef __SANITIZE_ADDRESS__
    // OpenVDB loses the node it is reading when a block does not unpack.
    const __lsan::ScopedDisabler leaks_of_openvdb;
#endif
    const double before = peak_megabytes();
    for (const std::string& bytes : small_files(temp_)) {
        std::fstream stream(with(bytes), std::ios::in | std::ios::out | std::ios::binary);
        const auto put = [&](std::size_t at, int value) {
            stream.seekp(static_cast<std::streamoff>(at)).put(static_cast<char>(value)).flush();
        };
        for (std::size_t at = 0; at < bytes.size(); ++at) {
            // Most bytes are zero, parts of masks and lengths: one huge value is enough for them.
            for (const int flip :
                 bytes[at] == 0 ? std::vector<int>{0xff} : std::vector<int>{0x01, 0x80, 0xff}) {
                put(at, bytes[at] ^ flip);
                opens(file());
            }
            put(at, bytes[at]);
        }
    }
    EXPECT_LT(peak_megabytes() - before, 400.0);
}

GridInfo info(const std::string& name, const std::string& type, const std::string& grid_class) {
    GridInfo grid;
    grid.name = grid.label = name;
    grid.type = type;
    grid.grid_class = grid_class;
    return grid;
}

TEST(ChooseGrid, TakesTheOnlyLevelSet) {
    EXPECT_EQ(choose_grid({info("density", "float", "fog volume"), info("x", "double", "level set"),
                           info("surface", "float", "unknown"), info("v", "vec3s", "level set")},
                          {}, "f.vdb")
                  .name,
              "x");
}

TEST(ChooseGrid, GoesByNameAmongSeveralInAFixedOrder) {
    const std::vector<GridInfo> grids{info("phi_out", "float", "level set"),
                                      info("SDF", "float", "level set"), info("Phi", "float", "level set")};
    EXPECT_EQ(choose_grid(grids, {}, "f.vdb").name, "Phi");
    EXPECT_EQ(choose_grid({grids[0], grids[1]}, {}, "f.vdb").name, "SDF");
    EXPECT_EQ(choose_grid({info("surface", "float", "unknown"), info("density", "float", "fog volume")}, {},
                          "f.vdb")
                  .name,
              "surface");
}

TEST(ChooseGrid, TakesTheOnlyGridOfNumbersWithoutALevelSet) {
    EXPECT_EQ(
        choose_grid({info("density", "float", "fog volume"), info("v", "vec3s", "staggered")}, {}, "f.vdb")
            .name,
        "density");
}

TEST(ChooseGrid, ListsTheCandidatesOtherwise) {
    const std::string several = refusal("f.vdb", [] {
        choose_grid({info("a", "float", "level set"), info("b", "float", "level set")}, {}, "f.vdb");
    });
    EXPECT_NE(several.find("a (float, level set), b (float, level set)"), std::string::npos);
    const std::string none =
        refusal("f.vdb", [] { choose_grid({info("Cd", "vec3s", "unknown")}, {}, "f.vdb"); });
    EXPECT_NE(none.find("Cd (vec3s, unknown)"), std::string::npos);
    EXPECT_NE(refusal("f.vdb", [] { choose_grid({}, {}, "f.vdb"); }).find("no grids"), std::string::npos);
    EXPECT_THROW(choose_grid({info("Cd", "vec3s", "unknown")}, "Cd", "f.vdb"), InputError);
}

TEST(ChooseGrid, FindsTheVelocity) {
    const std::vector<GridInfo> grids{info("velocity", "vec3s", "staggered"), info("Vel", "vec3d", "unknown"),
                                      info("v", "float", "unknown")};
    EXPECT_EQ(choose_velocity_grid(grids, {}, "f.vdb")->name, "Vel");
    EXPECT_EQ(choose_velocity_grid(grids, "velocity", "f.vdb")->name, "velocity");
    EXPECT_FALSE(choose_velocity_grid({grids[2]}, {}, "f.vdb"));
    EXPECT_THROW(choose_velocity_grid(grids, "v", "f.vdb"), InputError);
    EXPECT_THROW(choose_velocity_grid(grids, "motion", "f.vdb"), InputError);
}

// Files as they really come; where each is from is told beside them.
class SharedVdb : public testing::Test {
protected:
    void SetUp() override {
        if (!fs::is_directory(folder_)) GTEST_SKIP() << "no folder " << folder_;
    }
    std::string file(const std::string& name) const { return (folder_ / name).string(); }
    const fs::path folder_ = ISOTRACK_SHARED_DATA;
};

TEST_F(SharedVdb, EachIsListedAndReadOrRefusedInOneLine) {
    for (const char* folder : {"vdb", "vdb-odd"})
        for (const auto& entry : fs::directory_iterator(folder_ / folder)) {
            const std::string path = entry.path().string(), name = entry.path().filename().string();
            if (name == "damaged_truncated.vdb" || name == "not_a_vdb_git_lfs_pointer.vdb") {
                check_refusal(path);
                continue;
            }
            const std::vector<GridInfo> grids = list_grids(path);
            EXPECT_FALSE(grids.empty()) << path;
            for (const GridInfo& grid : grids) {
                if (grid.type != "float" && grid.type != "double" && grid.type != "vec3s") {
                    EXPECT_NE(refusal(path, [&] { read_grid(path, grid); }).find("type"), std::string::npos);
                    continue;
                }
                const openvdb::GridBase::Ptr read = read_grid(path, grid);
                EXPECT_EQ(read->getName(), grid.name) << path;
                EXPECT_EQ(read->activeVoxelCount(), grid.active_voxels.value_or(read->activeVoxelCount()))
                    << path;
            }
        }
}

TEST_F(SharedVdb, ReadsOldVersionsAsOpenVdbDoes) {
    for (const char* name :
         {"vdb/levelset_sphere_half_v222.vdb", "vdb/levelset_box_unnamed_wide_band_v223.vdb",
          "vdb/levelset_sphere_unnamed_offcentre.vdb"}) {
        openvdb::io::File reference_file(file(name));
        reference_file.open(false);
        const auto reference = openvdb::gridPtrCast<openvdb::FloatGrid>(reference_file.getGrids()->front());
        const auto grid =
            openvdb::gridPtrCast<openvdb::FloatGrid>(read_grid(file(name), list_grids(file(name))[0]));
        EXPECT_TRUE(grid->tree().hasSameTopology(reference->tree())) << name;
        for (auto value = reference->cbeginValueAll(); value; ++value)
            ASSERT_EQ(grid->tree().getValue(value.getCoord()), *value) << name;
    }
}

TEST_F(SharedVdb, ChoosesTheLiquidOfASimulation) {
    const std::string path = file("vdb-sequences/liquid_waterfall_frames_0001-0040/fluid_data_0001.vdb");
    const std::vector<GridInfo> grids = list_grids(path);
    EXPECT_EQ(grids.size(), 10u);
    const GridInfo chosen = choose_grid(grids, {}, path);
    EXPECT_EQ(chosen.label, "phi");
    EXPECT_TRUE(chosen.half);
    EXPECT_NEAR(chosen.voxel_size, 0.678731, 1e-6);
    EXPECT_EQ(read_grid(path, chosen)->activeVoxelCount(), 18432u);
    EXPECT_EQ(choose_velocity_grid(grids, {}, path)->label, "velocity");
    const auto points =
        std::find_if(grids.begin(), grids.end(), [](const GridInfo& g) { return g.type == "points"; });
    ASSERT_NE(points, grids.end());
    EXPECT_NE(refusal(path, [&] { read_grid(path, *points); }).find("points"), std::string::npos);
}

TEST_F(SharedVdb, DoesNotGuessAmongSeveralLevelSets) {
    const std::string path = file("vdb-odd/mantaflow_fire_24_grids_frame_0001.vdb");
    EXPECT_NE(refusal(path, [&] { choose_grid(list_grids(path), {}, path); }).find("phi_obstacle"),
              std::string::npos);
}

}  // namespace
}  // namespace isotrack
