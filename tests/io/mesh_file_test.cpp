#include "isotrack/io/mesh_file.h"

#include <gtest/gtest.h>

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"  // in OpenMesh, as in mesh_file.cpp
#include <OpenMesh/Core/IO/MeshIO.hh>
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#pragma GCC diagnostic pop

#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <set>
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

/// Coordinates that no short decimal hits.
TriangleMesh tetrahedron() {
    TriangleMesh mesh;
    mesh.points = {
        {0.1, 1.0 / 3.0, -1e-7}, {1e6 / 7.0, 0.0, 0.0}, {0.0, std::sqrt(2.0), 0.0}, {0.0, 0.0, 3.14159}};
    mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
    mesh.ids = {7, 0, std::numeric_limits<int>::max(), 12};
    mesh.velocities = {{1, 2, 3}, {0.1, 0.2, 0.3}, {0, 0, 0}, {-1e-9, 1e9, 0.5}};
    return mesh;
}

void expect_same_floats(const Vec3& a, const Vec3& b) {
    EXPECT_EQ(a.cast<float>(), b.cast<float>());
}

class MeshFile : public testing::Test {
protected:
    std::string with(const std::string& name, const std::string& bytes) const {
        std::ofstream(temp_.file(name), std::ios::binary) << bytes;
        return temp_.file(name);
    }
    static std::string refusal(const std::string& path) {
        try {
            read_mesh(path);
        } catch (const IoError& error) {
            EXPECT_NE(std::string(error.what()).find(fs::path(path).filename().string()), std::string::npos);
            return error.what();
        }
        ADD_FAILURE() << "was not refused: " << path;
        return {};
    }
    support::TempFolder temp_;
};

TEST_F(MeshFile, KnowsItsExtensions) {
    for (const char* name : {"a.ply", "a.OBJ", "b/c.off", "x.Stl", "a.b.vtk"})
        EXPECT_TRUE(is_mesh_extension(name));
    for (const char* name : {"a", "ply", "a.vdb", "a.ply.gz", ".ply"})
        EXPECT_FALSE(is_mesh_extension(name)) << name;
    EXPECT_THROW(write_mesh(tetrahedron(), temp_.file("a.xyz")), OptionError);
}

TEST_F(MeshFile, GivesBackEveryFloatAndFace) {
    const TriangleMesh mesh = tetrahedron();
    for (const char* name : {"m.ply", "m.obj", "m.off", "m.PLY"}) {
        write_mesh(mesh, temp_.file(name));
        const TriangleMesh read = read_mesh(temp_.file(name));
        ASSERT_EQ(read.points.size(), mesh.points.size()) << name;
        for (std::size_t i = 0; i < mesh.points.size(); ++i)
            expect_same_floats(read.points[i], mesh.points[i]);
        EXPECT_EQ(read.triangles, mesh.triangles) << name;
    }
}

TEST_F(MeshFile, GivesBackIdsAndVelocitiesOfPly) {
    const TriangleMesh mesh = tetrahedron();
    write_mesh(mesh, temp_.file("m.ply"));
    const TriangleMesh read = read_mesh(temp_.file("m.ply"));
    EXPECT_EQ(read.ids, mesh.ids);
    ASSERT_EQ(read.velocities.size(), mesh.velocities.size());
    for (std::size_t i = 0; i < mesh.velocities.size(); ++i)
        expect_same_floats(read.velocities[i], mesh.velocities[i]);

    TriangleMesh bare = mesh;
    bare.ids.clear();
    bare.velocities.clear();
    write_mesh(bare, temp_.file("m.ply"));
    EXPECT_TRUE(read_mesh(temp_.file("m.ply")).ids.empty());
    EXPECT_TRUE(read_mesh(temp_.file("m.ply")).velocities.empty());
}

TEST_F(MeshFile, WritesPlyByteForByteAsTheHeaderSays) {
    write_mesh(tetrahedron(), temp_.file("m.ply"));
    const std::string bytes = read_bytes(temp_.file("m.ply"));
    const std::string header =
        "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float "
        "y\nproperty float z\n"
        "property int id\nproperty float vx\nproperty float vy\nproperty float vz\n"
        "element face 4\nproperty list uchar int vertex_indices\nend_header\n";
    ASSERT_EQ(bytes.substr(0, header.size()), header);
    EXPECT_EQ(bytes.size(), header.size() + 4 * (7 * 4) + 4 * (1 + 3 * 4));
    std::int32_t id = 0;
    std::memcpy(&id, bytes.data() + header.size() + 12, 4);
    EXPECT_EQ(id, 7);
    float vy = 0.0f;
    std::memcpy(&vy, bytes.data() + header.size() + 20, 4);
    EXPECT_EQ(vy, 2.0f);
}

TEST_F(MeshFile, IsReadByOpenMesh) {
    using Mesh = OpenMesh::TriMesh_ArrayKernelT<>;
    for (const char* name : {"m.ply", "m.obj", "m.off", "m.stl"}) {
        write_mesh(tetrahedron(), temp_.file(name));
        Mesh mesh;
        ASSERT_TRUE(OpenMesh::IO::read_mesh(mesh, temp_.file(name))) << name;
        EXPECT_EQ(mesh.n_vertices(), 4u) << name;
        EXPECT_EQ(mesh.n_edges(), 6u) << name;
        EXPECT_EQ(mesh.n_faces(), 4u) << name;
    }
}

TEST_F(MeshFile, MergesTheEqualCornersOfStl) {
    const TriangleMesh mesh = tetrahedron();
    write_mesh(mesh, temp_.file("m.stl"));
    const TriangleMesh read = read_mesh(temp_.file("m.stl"));
    ASSERT_EQ(read.points.size(), 4u);
    ASSERT_EQ(read.triangles.size(), 4u);
    for (std::size_t t = 0; t < 4; ++t)
        for (std::size_t corner = 0; corner < 3; ++corner)
            expect_same_floats(read.points[static_cast<std::size_t>(read.triangles[t][corner])],
                               mesh.points[static_cast<std::size_t>(mesh.triangles[t][corner])]);
}

TEST_F(MeshFile, WritesVtkPolydata) {
    write_mesh(tetrahedron(), temp_.file("m.vtk"));
    std::istringstream in(read_bytes(temp_.file("m.vtk")));
    std::string line, word;
    std::getline(in, line);
    EXPECT_EQ(line.rfind("# vtk DataFile", 0), 0u);
    std::getline(in, line);
    in >> word;
    EXPECT_EQ(word, "ASCII");
    std::string all;
    while (in >> word) all += word + " ";
    EXPECT_NE(all.find("DATASET POLYDATA POINTS 4 float"), std::string::npos);
    EXPECT_NE(all.find("POLYGONS 4 16 3 0 2 1 3 0 1 3"), std::string::npos);
}

TEST_F(MeshFile, WritesAnEmptyMeshAsAValidFile) {
    for (const char* name : {"e.ply", "e.obj", "e.off", "e.stl", "e.vtk"}) {
        write_mesh(TriangleMesh{}, temp_.file(name));
        EXPECT_GT(fs::file_size(temp_.file(name)), 0u) << name;
        if (std::string(name) == "e.vtk") continue;
        const TriangleMesh read = read_mesh(temp_.file(name));
        EXPECT_TRUE(read.points.empty()) << name;
        EXPECT_TRUE(read.triangles.empty()) << name;
    }
}

TEST_F(MeshFile, KeepsFacesThatNoManifoldHas) {
    TriangleMesh mesh = tetrahedron();
    mesh.ids.clear();
    mesh.velocities.clear();
    mesh.triangles = {
        {0, 1, 2}, {0, 1, 3}, {1, 0, 2}, {0, 1, 2}, {0, 0, 1}};  // an edge of four faces, a twin, a sliver
    for (const char* name : {"m.ply", "m.obj", "m.off"}) {
        write_mesh(mesh, temp_.file(name));
        EXPECT_EQ(read_mesh(temp_.file(name)).triangles, mesh.triangles) << name;
    }
}

TEST_F(MeshFile, FansPolygons) {
    const std::string off = "OFF\n5 1 0\n0 0 0\n1 0 0\n2 1 0\n1 2 0\n0 1 0\n5 0 1 2 3 4\n";
    const std::vector<Triangle> fan{{0, 1, 2}, {0, 2, 3}, {0, 3, 4}};
    EXPECT_EQ(read_mesh(with("p.off", off)).triangles, fan);
    EXPECT_EQ(read_mesh(with("p.obj", "v 0 0 0\nv 1 0 0\nv 2 1 0\nv 1 2 0\nv 0 1 0\nf 1/1/1 2//1 3 4 -1\n"))
                  .triangles,
              fan);
}

TEST_F(MeshFile, ReadsForeignPly) {
    const std::string ascii =
        "ply\r\nformat ascii 1.0\r\ncomment by hand\r\nelement vertex 3\r\nproperty double x\r\nproperty "
        "double y\r\n"
        "property uchar red\r\nproperty double z\r\nproperty list uchar int neighbours\r\nelement face 1\r\n"
        "property uchar flag\r\nproperty list uint8 uint32 vertex_index\r\nelement edge 1\r\nproperty int "
        "a\r\n"
        "end_header\r\n0 0 255 0.1 0\r\n1 0 0 +2e0 2 5 6\r\n0 1 0 nan 0\r\n9 3 0 1 2\r\n4\r\n";
    const TriangleMesh mesh = read_mesh(with("a.ply", ascii));
    ASSERT_EQ(mesh.points.size(), 3u);
    EXPECT_EQ(mesh.points[0], Vec3(0, 0, 0.1));
    EXPECT_EQ(mesh.points[1], Vec3(1, 0, 2));
    EXPECT_TRUE(std::isnan(mesh.points[2].z()));
    EXPECT_EQ(mesh.triangles, (std::vector<Triangle>{{0, 1, 2}}));

    std::string big =
        "ply\nformat binary_big_endian 1.0\nelement vertex 1\nproperty float x\nproperty short y\n"
        "property float z\nend_header\n";
    big +=
        std::string("\x3f\x80\x00\x00", 4) + std::string("\x01\x02", 2) + std::string("\xc0\x00\x00\x00", 4);
    EXPECT_EQ(read_mesh(with("b.ply", big)).points[0], Vec3(1.0, 258.0, -2.0));
}

TEST_F(MeshFile, RefusesDamagedFilesOfEveryFormat) {
    EXPECT_NE(refusal(temp_.file("missing.ply")).find("No such file"), std::string::npos);
    EXPECT_NE(refusal(temp_.file("missing.obj")).find("No such file"), std::string::npos);
    refusal(with("a.xyz", "1 2 3"));
    for (const char* name : {"g.ply", "g.off", "g.stl", "g.obj"})
        refusal(with(name, "nothing of the kind\n"));
    refusal(with("huge.off", "OFF\n2000000000 1 0\n0 0 0\n"));
    refusal(with("range.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"));
    refusal(with("range.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n"));
    refusal(with("range.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -4\n"));
    const std::string ply =
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
    EXPECT_EQ(read_mesh(with("r.ply", ply + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")).triangles.size(), 1u);
    refusal(with("r.ply", ply + "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"));
    refusal(with("r.ply", ply + "0 0 0\n1 0 0\n0 1 0\n3 0 -1 2\n"));
    refusal(with("r.ply", ply + "0 0 0\n1 0 0\n0 1 0\n3 0 one 2\n"));
    refusal(with("r.ply", ply + "0 0 0\n1 0 0\n"));
    refusal(with("h.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty quad x\nend_header\n"));
    refusal(with("h.ply", "ply\nformat ascii 1.0\nelement vertex -3\nend_header\n"));
}

TEST_F(MeshFile, RefusesAPlyCutAtAnyByte) {
    write_mesh(tetrahedron(), temp_.file("m.ply"));
    for (std::size_t length = read_bytes(temp_.file("m.ply")).size(); length-- > 0;) {
        fs::resize_file(temp_.file("m.ply"), length);
        EXPECT_THROW(read_mesh(temp_.file("m.ply")), IoError) << length;
    }
}

TEST_F(MeshFile, RefusesIdsBeyond32BitsWhereTheyAreWritten) {
    TriangleMesh mesh = tetrahedron();
    mesh.ids[1] = Id{1} << 31;
    EXPECT_THROW(write_mesh(mesh, temp_.file("m.ply")), OptionError);
    EXPECT_NO_THROW(write_mesh(mesh, temp_.file("m.obj")));
}

TEST_F(MeshFile, ReplacesTheOldFileOrLeavesItAlone) {
    write_mesh(tetrahedron(), temp_.file("m.ply"));
    const std::string before = read_bytes(temp_.file("m.ply"));
    TriangleMesh bad = tetrahedron();
    bad.ids[0] = -1;
    EXPECT_THROW(write_mesh(bad, temp_.file("m.ply")), OptionError);
    EXPECT_EQ(read_bytes(temp_.file("m.ply")), before);
    write_mesh(TriangleMesh{}, temp_.file("m.ply"));
    EXPECT_LT(fs::file_size(temp_.file("m.ply")), before.size());
    EXPECT_EQ(std::distance(fs::directory_iterator(temp_.path()), {}), 1) << "a temporary file is left";
    EXPECT_THROW(write_mesh(tetrahedron(), temp_.file("nowhere/m.ply")), IoError);
}

TEST_F(MeshFile, WritesWithoutAWord) {
    testing::internal::CaptureStderr();
    testing::internal::CaptureStdout();
    for (const char* name : {"m.ply", "m.obj", "m.off", "m.stl", "m.vtk"})
        write_mesh(tetrahedron(), temp_.file(name));
    EXPECT_EQ(testing::internal::GetCapturedStdout(), "");
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

TEST(SharedMeshes, AreReadWithTheCountsStatedBesideThem) {
    const fs::path folder = fs::path(ISOTRACK_SHARED_DATA) / "meshes";
    if (!fs::is_directory(folder)) GTEST_SKIP() << "no folder " << folder;
    const TriangleMesh bunny = read_mesh((folder / "stanford_bunny_3485.off").string());
    EXPECT_EQ(bunny.points.size(), 3485u);
    EXPECT_EQ(bunny.triangles.size(), 6966u);
    std::set<std::pair<int, int>> half_edges;
    for (const Triangle& t : bunny.triangles)
        for (std::size_t i = 0; i < 3; ++i) half_edges.insert({t[i], t[(i + 1) % 3]});
    EXPECT_EQ(half_edges.size(), 3 * bunny.triangles.size());  // oriented consistently
    EXPECT_EQ(read_mesh((folder / "camel.off").string()).triangles.size(), 19536u);
}

}  // namespace
}  // namespace isotrack
