// Writing goes through OpenMesh, also `id` and `vx vy vz`: its PLY writer carries scalar properties in
// binary. It gets the face list itself rather than a half-edge mesh, which costs nothing to build and can
// hold any faces. Reading does not: OpenMesh 9 reads custom properties from ASCII alone, drops degenerate
// faces, duplicates the vertices of complex edges and writes words to stderr. PLY is therefore read here, and
// the formats without properties by CGAL, as a list of polygons.
#include "isotrack/io/mesh_file.h"

#include <CGAL/IO/OBJ.h>
#include <CGAL/IO/OFF.h>
#include <CGAL/IO/STL.h>
#include <CGAL/Simple_cartesian.h>
#include <fmt/format.h>

// OpenMesh makes points without values on purpose; gcc 12 takes that for a slip.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#include <OpenMesh/Core/IO/MeshIO.hh>
#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#pragma GCC diagnostic pop

#include <algorithm>
#include <cassert>
#include <cctype>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <optional>
#include <sstream>
#include <string_view>

#include "io/atomic_file.h"
#include "isotrack/error.h"

namespace isotrack {
namespace {

using Vertices = OpenMesh::TriMesh_ArrayKernelT<>;  // without faces
using Polygons = std::vector<std::vector<std::size_t>>;

constexpr int kFloatDigits = std::numeric_limits<float>::max_digits10;

std::string extension_of(const std::string& path) {
    std::string extension = std::filesystem::path(path).extension().string();
    std::transform(extension.begin(), extension.end(), extension.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return extension;
}

/// OpenMesh's view of a triangle list.
class TriangleExporter : public OpenMesh::IO::ExporterT<Vertices> {
public:
    TriangleExporter(const Vertices& vertices, const std::vector<Triangle>& triangles)
        : ExporterT(vertices), triangles_(triangles) {}

    std::size_t n_faces() const override { return triangles_.size(); }

    unsigned get_vhandles(OpenMesh::FaceHandle face,
                          std::vector<OpenMesh::VertexHandle>& corners) const override {
        corners.clear();
        for (const int vertex : triangles_[static_cast<std::size_t>(face.idx())])
            corners.emplace_back(vertex);
        return 3;
    }

private:
    const std::vector<Triangle>& triangles_;
};

/// Adds a property that the PLY writer will see.
template <typename T>
OpenMesh::VPropHandleT<T> add_property(Vertices& vertices, const std::string& name) {
    OpenMesh::VPropHandleT<T> handle;
    vertices.add_property(handle, name);
    vertices.property(handle).set_persistent(true);
    return handle;
}

Vertices make_vertices(const TriangleMesh& mesh) {
    Vertices vertices;
    vertices.reserve(mesh.points.size(), 0, 0);
    for (const Vec3& p : mesh.points) {
        const Eigen::Vector3f q = p.cast<float>();
        vertices.add_vertex({q.x(), q.y(), q.z()});
    }
    return vertices;
}

void add_ids(Vertices& vertices, const std::vector<Id>& ids) {
    const auto id = add_property<int>(vertices, "id");
    for (std::size_t i = 0; i < ids.size(); ++i) {
        if (ids[i] < 0 || ids[i] > std::numeric_limits<int>::max())
            throw OptionError(fmt::format("id {} does not fit the 32 bits a mesh file has for it", ids[i]));
        vertices.property(id, OpenMesh::VertexHandle(static_cast<int>(i))) = static_cast<int>(ids[i]);
    }
}

void add_velocities(Vertices& vertices, const std::vector<Vec3>& velocities) {
    const std::array<const char*, 3> names{"vx", "vy", "vz"};
    for (int axis = 0; axis < 3; ++axis) {
        const auto component = add_property<float>(vertices, names[static_cast<std::size_t>(axis)]);
        for (std::size_t i = 0; i < velocities.size(); ++i)
            vertices.property(component, OpenMesh::VertexHandle(static_cast<int>(i))) =
                static_cast<float>(velocities[i][axis]);
    }
}

[[noreturn]] void fail_to_read(const std::string& path, const std::string& cause) {
    throw IoError(fmt::format("cannot read '{}': {}", path, cause));
}

/// Reads a PLY file of any of its three encodings from memory.
class PlyReader {
public:
    PlyReader(const std::string& path, std::string_view bytes) : path_(path), bytes_(bytes) {}

    void read(TriangleMesh& mesh, Polygons& polygons) {
        read_header();
        for (const Element& element : elements_) {
            if (element.properties.empty()) continue;
            if (element.name == "vertex")
                read_vertices(element, mesh);
            else
                read_lists(element, element.name == "face" ? &polygons : nullptr);
        }
    }

private:
    enum class Type { Int8, UInt8, Int16, UInt16, Int32, UInt32, Float, Double };
    struct Property {
        std::string name;
        Type type;
        std::optional<Type> count_type;  ///< Set for a list.
    };
    struct Element {
        std::string name;
        std::size_t count = 0;
        std::vector<Property> properties;

        /// Index of the scalar property called `wanted`; properties.size() if there is none.
        std::size_t find(const std::string& wanted) const {
            return static_cast<std::size_t>(
                std::find_if(properties.begin(), properties.end(),
                             [&](const Property& p) { return p.name == wanted && !p.count_type; }) -
                properties.begin());
        }
        bool has(const std::string& wanted) const { return find(wanted) < properties.size(); }
    };

    std::string line() {
        const std::size_t end = bytes_.find('\n', at_);
        if (end == std::string_view::npos) fail_to_read(path_, "its PLY header has no end");
        std::string text(bytes_.substr(at_, end - at_));
        if (!text.empty() && text.back() == '\r') text.pop_back();
        at_ = end + 1;
        return text;
    }

    Type type_of(const std::string& name) const {
        const std::array<std::array<const char*, 2>, 8> names{{{"char", "int8"},
                                                               {"uchar", "uint8"},
                                                               {"short", "int16"},
                                                               {"ushort", "uint16"},
                                                               {"int", "int32"},
                                                               {"uint", "uint32"},
                                                               {"float", "float32"},
                                                               {"double", "float64"}}};
        for (std::size_t i = 0; i < names.size(); ++i)
            if (name == names[i][0] || name == names[i][1]) return static_cast<Type>(i);
        fail_to_read(path_, fmt::format("'{}' is no PLY type", name));
    }

    void read_header() {
        if (line() != "ply") fail_to_read(path_, "it is not a PLY file");
        bool has_format = false;
        for (std::string text = line(); text != "end_header"; text = line()) {
            std::istringstream words(text);
            std::string keyword, first, second, third, fourth;
            words >> keyword >> first >> second >> third >> fourth;
            if (keyword == "format") {
                has_format = true;
                ascii_ = first == "ascii";
                big_endian_ = first == "binary_big_endian";
                if (!ascii_ && !big_endian_ && first != "binary_little_endian")
                    fail_to_read(path_, fmt::format("'{}' is no PLY format", first));
            } else if (keyword == "element") {
                Element element{first, 0, {}};
                const char* end = second.data() + second.size();
                if (const auto parsed = std::from_chars(second.data(), end, element.count);
                    parsed.ec != std::errc() || parsed.ptr != end)
                    fail_to_read(path_, fmt::format("'{}' is no number of elements", second));
                elements_.push_back(element);
            } else if (keyword == "property" && !elements_.empty()) {
                elements_.back().properties.push_back(first == "list"
                                                          ? Property{fourth, type_of(third), type_of(second)}
                                                          : Property{second, type_of(first), std::nullopt});
            } else if (keyword != "comment" && keyword != "obj_info" && !keyword.empty()) {
                fail_to_read(path_, fmt::format("'{}' does not belong into a PLY header", keyword));
            }
        }
        if (!has_format) fail_to_read(path_, "its PLY header states no format");
    }

    template <typename T>
    double binary() {
        if (bytes_.size() - at_ < sizeof(T)) fail_to_read(path_, "it is cut off");
        std::array<char, sizeof(T)> raw;
        std::memcpy(raw.data(), bytes_.data() + at_, sizeof(T));
        at_ += sizeof(T);
        if (big_endian_) std::reverse(raw.begin(), raw.end());
        T value;
        std::memcpy(&value, raw.data(), sizeof(T));
        return static_cast<double>(value);
    }

    double word() {
        const auto is_space = [](char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; };
        while (at_ < bytes_.size() && (is_space(bytes_[at_]) || bytes_[at_] == '+')) ++at_;
        if (at_ == bytes_.size()) fail_to_read(path_, "it is cut off");
        double value = 0.0;
        const char* end = bytes_.data() + bytes_.size();
        const auto parsed = std::from_chars(bytes_.data() + at_, end, value);
        if (parsed.ec == std::errc::invalid_argument || (parsed.ptr != end && !is_space(*parsed.ptr)))
            fail_to_read(path_, fmt::format("no number at byte {}", at_));
        at_ = static_cast<std::size_t>(parsed.ptr - bytes_.data());
        return value;
    }

    double number(Type type) {
        if (ascii_) return word();
        switch (type) {
            case Type::Int8:
                return binary<std::int8_t>();
            case Type::UInt8:
                return binary<std::uint8_t>();
            case Type::Int16:
                return binary<std::int16_t>();
            case Type::UInt16:
                return binary<std::uint16_t>();
            case Type::Int32:
                return binary<std::int32_t>();
            case Type::UInt32:
                return binary<std::uint32_t>();
            case Type::Float:
                return binary<float>();
            case Type::Double:
                break;
        }
        return binary<double>();
    }

    /// Entries of a list. Not reserved ahead: the count is the file's word, the entries are its bytes.
    std::vector<double> list(const Property& property) {
        std::vector<double> values;
        const double count = number(*property.count_type);
        for (double i = 0; i < count; ++i) values.push_back(number(property.type));
        return values;
    }

    void read_vertices(const Element& element, TriangleMesh& mesh) {
        for (const char* name : {"x", "y", "z"})
            if (!element.has(name)) fail_to_read(path_, fmt::format("its vertices have no '{}'", name));
        const bool has_id = element.has("id");
        const bool has_velocity = element.has("vx") && element.has("vy") && element.has("vz");
        std::vector<double> values(element.properties.size() + 1);
        const auto vector = [&](const char* x, const char* y, const char* z) {
            return Vec3(values[element.find(x)], values[element.find(y)], values[element.find(z)]);
        };
        for (std::size_t i = 0; i < element.count; ++i) {
            for (std::size_t p = 0; p < element.properties.size(); ++p) {
                if (element.properties[p].count_type)
                    list(element.properties[p]);
                else
                    values[p] = number(element.properties[p].type);
            }
            mesh.points.push_back(vector("x", "y", "z"));
            if (has_id) mesh.ids.push_back(static_cast<Id>(values[element.find("id")]));
            if (has_velocity) mesh.velocities.push_back(vector("vx", "vy", "vz"));
        }
    }

    /// Goes through an element; for faces keeps the list of vertices.
    void read_lists(const Element& element, Polygons* polygons) {
        for (std::size_t i = 0; i < element.count; ++i)
            for (const Property& property : element.properties) {
                if (!property.count_type) {
                    number(property.type);
                    continue;
                }
                const std::vector<double> values = list(property);
                if (!polygons || (property.name != "vertex_indices" && property.name != "vertex_index"))
                    continue;
                // No vertex has a negative or broken index; the caller refuses what is too large.
                polygons->emplace_back();
                for (const double value : values)
                    polygons->back().push_back(value >= 0.0 ? static_cast<std::size_t>(value)
                                                            : std::numeric_limits<std::size_t>::max());
            }
    }

    const std::string& path_;
    std::string_view bytes_;
    std::size_t at_ = 0;
    bool ascii_ = false, big_endian_ = false;
    std::vector<Element> elements_;
};

std::string read_bytes(const std::string& path) {
    std::error_code error;
    if (std::filesystem::is_directory(path, error)) fail_to_read(path, "it is a folder");
    errno = 0;
    std::ifstream stream(path, std::ios::binary);
    std::string bytes{std::istreambuf_iterator<char>(stream), {}};
    if (!stream && errno != 0) fail_to_read(path, std::strerror(errno));
    return bytes;
}

void read_soup(const std::string& path, const std::string& extension, const std::string& bytes,
               TriangleMesh& mesh, Polygons& polygons) {
    std::vector<CGAL::Simple_cartesian<double>::Point_3> points;
    std::istringstream stream(bytes);
    bool good = false;
    if (extension == ".obj") {
        // CGAL takes an OBJ without faces for a failure; reading on to the end tells it from a broken one.
        good = CGAL::IO::read_OBJ(stream, points, polygons) || (polygons.empty() && stream.eof());
    } else if (extension == ".off") {
        // CGAL makes room for what the header states before it looks for it.
        CGAL::File_header_OFF header;
        stream >> header;
        good = stream && header.size_of_vertices() <= bytes.size() && header.size_of_facets() <= bytes.size();
        stream.clear();
        stream.seekg(0);
        good = good && CGAL::IO::read_OFF(stream, points, polygons);
    } else {
        // CGAL takes anything shorter than a binary header for an empty file.
        constexpr std::size_t kShortestBinary = 84;
        good = (bytes.size() >= kShortestBinary || bytes.rfind("solid", 0) == 0) &&
               CGAL::IO::read_STL(stream, points, polygons);
    }
    if (!good) fail_to_read(path, fmt::format("damaged, cut off, or no {} file", extension.substr(1)));
    for (const auto& p : points) mesh.points.emplace_back(p.x(), p.y(), p.z());
}

/// Fans around the first corner.
void triangulate(const std::string& path, const Polygons& polygons, TriangleMesh& mesh) {
    for (const std::vector<std::size_t>& polygon : polygons) {
        for (const std::size_t vertex : polygon)
            if (vertex >= mesh.points.size())
                fail_to_read(
                    path, fmt::format("a face names a vertex that is not among the {}", mesh.points.size()));
        for (std::size_t i = 2; i < polygon.size(); ++i)
            mesh.triangles.push_back({static_cast<int>(polygon[0]), static_cast<int>(polygon[i - 1]),
                                      static_cast<int>(polygon[i])});
    }
}

}  // namespace

bool is_mesh_extension(const std::string& path) {
    const std::string extension = extension_of(path);
    for (const char* known : {".ply", ".obj", ".off", ".stl", ".vtk"})
        if (extension == known) return true;
    return false;
}

void write_mesh(const TriangleMesh& mesh, const std::string& path) {
    if (!is_mesh_extension(path))
        throw OptionError(fmt::format("'{}': a mesh file ends in .ply, .obj, .off, .stl or .vtk", path));
    assert(mesh.ids.empty() || mesh.ids.size() == mesh.points.size());
    assert(mesh.velocities.empty() || mesh.velocities.size() == mesh.points.size());

    const std::string extension = extension_of(path);
    Vertices vertices = make_vertices(mesh);
    OpenMesh::IO::Options options;
    if (extension == ".ply" || extension == ".stl") options += OpenMesh::IO::Options::Binary;
    if (extension == ".ply") {
        options += OpenMesh::IO::Options::Custom;
        if (!mesh.ids.empty()) add_ids(vertices, mesh.ids);
        if (!mesh.velocities.empty()) add_velocities(vertices, mesh.velocities);
    }
    TriangleExporter exporter(vertices, mesh.triangles);
    static const bool kSilent =
        (omlog().disable(), true);  // OpenMesh reports each file that it writes, to stderr
    (void)kSilent;
    write_atomically(path, [&](std::ostream& out) {
        if (!OpenMesh::IO::IOManager().write(out, extension, exporter, options, kFloatDigits))
            throw IoError(fmt::format("cannot write '{}': OpenMesh refused the mesh", path));
    });
}

TriangleMesh read_mesh(const std::string& path) {
    const std::string extension = extension_of(path);
    if (extension != ".ply" && extension != ".obj" && extension != ".off" && extension != ".stl")
        fail_to_read(path, "a mesh to read ends in .ply, .obj, .off or .stl");
    const std::string bytes = read_bytes(path);
    TriangleMesh mesh;
    Polygons polygons;
    try {
        if (extension == ".ply")
            PlyReader(path, bytes).read(mesh, polygons);
        else
            read_soup(path, extension, bytes, mesh, polygons);
    } catch (const IoError&) {
        throw;
    } catch (const std::exception& error) {
        fail_to_read(path, error.what());
    }
    triangulate(path, polygons, mesh);
    return mesh;
}

}  // namespace isotrack
