// OpenVDB 10 believes every length a file states: 300 bytes of a file cut off inside its header make it ask
// for gigabytes, and a block of voxels with a wrong length overruns its buffer. So the head of the file is
// read here, each length checked against what is left, the tree is checked by a `VdbTreeWalk`, and OpenVDB
// gets the checked bytes of one grid's tree and nothing else. Format: openvdb/io/Archive.cc,
// io/GridDescriptor.cc and MetaMap.cc of OpenVDB 10.0.1.
#include "isotrack/io/vdb_file.h"

#include <fmt/format.h>
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/io/io.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <new>
#include <sstream>
#include <string_view>

#include "io/vdb_tree_read.h"
#include "io/vdb_tree_walk.h"
#include "isotrack/error.h"

namespace isotrack {
namespace {

using openvdb::io::GridDescriptor;

// Of 2013. Older files need decoders that newer OpenVDBs have dropped.
constexpr std::uint32_t kOldestVersion = openvdb::OPENVDB_FILE_VERSION_NODE_MASK_COMPRESSION;
constexpr std::size_t kUuidLength = 36;
constexpr std::size_t kLongestMessage = 300;
constexpr std::size_t kLongestPath = 160;  // leaves room for the cause

/// Names in a damaged file may hold anything; terminals and logs must not see it.
std::string printable(std::string text) {
    for (char& c : text)
        if (const auto byte = static_cast<unsigned char>(c); byte < 0x20 || byte == 0x7f) c = '?';
    return text;
}

std::string clamped(const std::string& text, std::size_t length) {
    return text.size() <= length ? text : text.substr(0, length - 3) + "...";
}

[[noreturn]] void fail(const std::string& path, const std::string& cause) {
    const std::string shown =
        path.size() <= kLongestPath ? path : "..." + path.substr(path.size() - kLongestPath + 3);
    throw IoError(clamped(printable(fmt::format("cannot read '{}': {}", shown, cause)), kLongestMessage));
}

/// Whatever OpenVDB or the stream throws leaves as an `IoError`.
template <typename Work>
auto guarded(const std::string& path, const Work& work) {
    try {
        return work();
    } catch (const IoError&) {
        throw;
    } catch (const std::ios_base::failure&) {
        fail(path, "its voxels end too early; damaged, or still being written");
    } catch (const std::bad_alloc&) {
        fail(path, "not enough memory; damaged, or too large for this machine");
    } catch (const std::exception& error) {
        fail(path, error.what());
    }
}

/// One grid as the file's directory describes it.
struct Record {
    std::string unique_name;  ///< The name; where it is not unique, a \x1e and a number follow.
    std::string type;         ///< OpenVDB's: "Tree_float_5_4_3".
    std::string parent;       ///< Unique name of the grid whose tree this one shares; mostly empty.
    bool half = false;
    std::int64_t grid_pos = 0, tree_pos = 0, end_pos = 0;
    std::uint32_t compression = 0;
    openvdb::MetaMap metadata;
    openvdb::math::Transform::Ptr transform;  ///< Null where OpenVDB cannot make it; then the cause follows.
    std::string transform_error;

    std::string name() const { return GridDescriptor::stripSuffix(unique_name); }
    std::string shown_name() const { return GridDescriptor::nameAsString(unique_name); }
};

/// "uniform" for OpenVDB's UniformScaleTranslateMap, and so on.
std::string transform_name(const openvdb::math::Transform& transform) {
    const std::string type = transform.mapType();
    const std::array<std::pair<const char*, const char*>, 6> names{{{"UniformScale", "uniform"},
                                                                    {"Scale", "scale"},
                                                                    {"Translation", "translation"},
                                                                    {"Unitary", "rotation"},
                                                                    {"Affine", "affine"},
                                                                    {"NonlinearFrustum", "frustum"}}};
    for (const auto& [prefix, name] : names)
        if (type.rfind(prefix, 0) == 0) return name;
    return type;
}

/// "float" for OpenVDB's "Tree_float_5_4_3"; trees of another shape keep their full name, since nothing here
/// can read them.
std::string short_type(const std::string& type) {
    constexpr std::string_view kPrefix = "Tree_", kShape = "_5_4_3";
    if (type.size() <= kPrefix.size() + kShape.size() || type.rfind(kPrefix, 0) != 0 ||
        type.compare(type.size() - kShape.size(), kShape.size(), kShape) != 0)
        return printable(type);
    const std::string value = type.substr(kPrefix.size(), type.size() - kPrefix.size() - kShape.size());
    return value == "ptdataidx32" ? "points" : printable(value);
}

/// nullopt for a type that is of no use here, and that is not known well enough to be given to OpenVDB.
std::optional<VdbValueLayout> layout_of(const Record& record) {
    const std::string type = short_type(record.type);
    const std::size_t components = type == "float" || type == "double" ? 1 : 3;
    const bool is_float = type == "float" || type == "vec3s";
    if (!is_float && type != "double" && type != "vec3d") return std::nullopt;
    // As OpenVDB has it: what counts is the metadata, not the type's suffix.
    const auto half = record.metadata[openvdb::GridBase::META_SAVE_HALF_FLOAT];
    VdbValueLayout layout{};
    layout.half = half && half->asBool();
    layout.value_bytes = components * (is_float ? sizeof(float) : sizeof(double));
    layout.stored_bytes = layout.half ? components * sizeof(openvdb::math::half) : layout.value_bytes;
    layout.compression = record.compression;
    return layout;
}

class VdbFile {
public:
    /// Opens the file and checks header and directory.
    explicit VdbFile(const std::string& path) : path_(path) {
        check_kind();
        stream_.open(path, std::ios::binary);
        if (!stream_) fail(path_, std::strerror(errno));
        stream_.exceptions(std::ios::failbit | std::ios::badbit | std::ios::eofbit);
        read_header();
        read_directory();
    }

    const std::vector<Record>& grids() const { return grids_; }

    /// The grids of a file written as a stream lie one behind the other: the end of one must be found to find
    /// the next.
    void find_streamed_grids();

    openvdb::GridBase::Ptr read(const Record& record);

private:
    void check_kind();
    void read_header();
    void read_directory();
    Record read_descriptor(std::int32_t number);
    void read_head(Record& record);
    void read_transform(Record& record);
    openvdb::MetaMap read_metadata(const std::string& owner);
    void read_entry(openvdb::MetaMap& metadata, const std::string& name, const std::string& type);
    VdbTreeWalk walk_tree(const Record& record, const VdbValueLayout& layout);
    std::int64_t end_of_tree(const Record& record, const VdbValueLayout& layout);
    openvdb::GridBase::Ptr read_voxels(const Record& record);

    std::int64_t position() { return static_cast<std::int64_t>(stream_.tellg()); }

    /// Refuses to read `bytes` bytes of `what` when they are not there.
    void need(std::uint64_t bytes, const std::string& what) {
        if (bytes > static_cast<std::uint64_t>(limit_ - position()))
            fail(path_, fmt::format("{} is cut off or damaged: {} reaches beyond its end at byte {}",
                                    limit_ == size_ ? "the file" : "a grid", what, limit_));
    }

    template <typename T>
    T number(const std::string& what) {
        need(sizeof(T), what);
        T value;
        stream_.read(reinterpret_cast<char*>(&value), sizeof(T));
        return value;
    }

    std::string bytes(std::uint32_t length, const std::string& what) {
        need(length, what);
        std::string value(length, '\0');
        stream_.read(value.data(), length);
        return value;
    }

    std::string text(const std::string& what) { return bytes(number<std::uint32_t>(what), what); }

    std::string path_;
    std::ifstream stream_;
    std::int64_t size_ = 0, limit_ = 0;  ///< Length of the file; where the part being read must end.
    std::uint32_t file_version_ = 0;
    openvdb::VersionId library_version_;
    bool has_offsets_ = true;
    std::int32_t grid_count_ = 0;
    std::vector<Record> grids_;
};

void VdbFile::check_kind() {
    struct stat status;
    if (::stat(path_.c_str(), &status) != 0) fail(path_, std::strerror(errno));
    if (S_ISDIR(status.st_mode)) fail(path_, "it is a folder, expected a VDB file");
    if (!S_ISREG(status.st_mode)) fail(path_, "it is not a regular file");
    if (status.st_size == 0) fail(path_, "the file is empty (0 bytes)");
    size_ = limit_ = status.st_size;
}

void VdbFile::read_header() {
    const std::string start =
        bytes(static_cast<std::uint32_t>(std::min<std::int64_t>(size_, 40)), "the start");
    if (start.rfind("version https://git-lfs", 0) == 0)
        fail(path_, "it is a Git LFS pointer, not the data; fetch it with 'git lfs pull'");
    if (start.rfind("\x1f\x8b", 0) == 0) fail(path_, "it is compressed by gzip; unpack it first");
    stream_.seekg(0);
    if (size_ < 8 || number<std::int64_t>("the magic number") != openvdb::OPENVDB_MAGIC)
        fail(path_, "it is not a VDB file (wrong magic number)");

    file_version_ = number<std::uint32_t>("the file version");
    if (file_version_ < kOldestVersion)
        fail(path_,
             fmt::format("VDB file version {} is older than {}; rewrite it with an OpenVDB of its time",
                         file_version_, kOldestVersion));
    library_version_.first = number<std::uint32_t>("the library version");
    library_version_.second = number<std::uint32_t>("the library version");
    has_offsets_ = number<char>("the header") != 0;
    bytes(kUuidLength, "the header");
    read_metadata("the file");
    grid_count_ = number<std::int32_t>("the number of grids");
    if (grid_count_ < 0) fail(path_, fmt::format("damaged: it states {} grids", grid_count_));
}

void VdbFile::read_directory() {
    for (std::int32_t i = 0; i < grid_count_; ++i) {
        Record record = read_descriptor(i);
        const std::int64_t after = position();
        if (!has_offsets_) {
            record.grid_pos = after;
            record.end_pos = size_;
            read_head(record);
            grids_.push_back(std::move(record));
            return;
        }
        // Positions that only ever grow also bound this loop, whatever number of grids the file states.
        if (record.end_pos > size_)
            fail(path_,
                 fmt::format("cut off: {} bytes long, but grid '{}' ends at byte {}; an incomplete copy, or "
                             "still being written",
                             size_, record.shown_name(), record.end_pos));
        if (record.grid_pos < after || record.end_pos < record.grid_pos)
            fail(path_, fmt::format("damaged: grid '{}' is said to lie at bytes {} to {}",
                                    record.shown_name(), record.grid_pos, record.end_pos));
        read_head(record);
        stream_.seekg(record.end_pos);
        grids_.push_back(std::move(record));
    }
}

Record VdbFile::read_descriptor(std::int32_t number_of_grid) {
    const std::string what = fmt::format("the description of grid {} of {}", number_of_grid + 1, grid_count_);
    Record record;
    record.unique_name = text(what);
    record.type = text(what);
    constexpr std::string_view kHalf = "_HalfFloat";
    if (record.type.size() >= kHalf.size() &&
        record.type.compare(record.type.size() - kHalf.size(), kHalf.size(), kHalf) == 0) {
        record.half = true;
        record.type.resize(record.type.size() - kHalf.size());
    }
    record.parent = text(what);
    record.grid_pos = number<std::int64_t>(what);
    number<std::int64_t>(what);  // of the voxels; an instance has none
    record.end_pos = number<std::int64_t>(what);
    return record;
}

void VdbFile::read_head(Record& record) {
    limit_ = record.end_pos;
    stream_.seekg(record.grid_pos);
    const std::string owner = fmt::format("grid '{}'", record.shown_name());
    record.compression = number<std::uint32_t>(owner);
    record.metadata = read_metadata(owner);
    // The transform's type is the last string that OpenVDB will read without looking at its length.
    const std::int64_t transform_pos = position();
    text(fmt::format("the transform of {}", owner));
    stream_.seekg(transform_pos);
    read_transform(record);
    limit_ = size_;
}

/// A transform that OpenVDB cannot make does not keep the file's other grids from use.
void VdbFile::read_transform(Record& record) {
    try {
        openvdb::io::setVersion(stream_, library_version_, file_version_);
        auto transform = openvdb::math::Transform::createLinearTransform();
        transform->read(stream_);
        record.tree_pos = position();
        if (record.tree_pos <= record.end_pos)
            record.transform = transform;
        else
            record.transform_error = "it reaches beyond the end of the grid";
    } catch (const std::exception& error) {
        stream_.clear();
        record.transform_error = error.what();
    }
}

openvdb::MetaMap VdbFile::read_metadata(const std::string& owner) {
    const std::string what = "the metadata of " + owner;
    openvdb::MetaMap metadata;
    const auto count = number<std::uint32_t>(what);
    for (std::uint32_t i = 0; i < count; ++i) {
        const std::string name = text(what), type = text(what);
        read_entry(metadata, name, type);
    }
    return metadata;
}

/// Keeps what OpenVDB understands. Its own reader trusts a type's size over the one stated, and lists of
/// leaves for delayed loading over the file's length; the first is left out, and so are all types of the
/// library's inner use, which begin with two underscores.
void VdbFile::read_entry(openvdb::MetaMap& metadata, const std::string& name, const std::string& type) {
    const auto length = number<std::uint32_t>("the metadata '" + name + "'");
    const std::string value = bytes(length, "the metadata '" + name + "'");
    if (name.empty() || type.rfind("__", 0) == 0 || !openvdb::Metadata::isRegisteredType(type)) return;
    const openvdb::Metadata::Ptr entry = openvdb::Metadata::createMetadata(type);
    if (type != openvdb::StringMetadata::staticTypeName() && entry->size() != length) return;
    std::istringstream stream(std::string(reinterpret_cast<const char*>(&length), sizeof(length)) + value);
    entry->read(stream);
    if (!metadata[name]) metadata.insertMeta(name, *entry);
}

void VdbFile::find_streamed_grids() {
    if (has_offsets_) return;
    for (std::int32_t i = 1; i < grid_count_; ++i) {
        Record& last = grids_.back();
        const std::optional<VdbValueLayout> layout = layout_of(last);
        if (!layout || !last.transform) return;  // where the next grid begins is not known
        last.end_pos = last.parent.empty() ? end_of_tree(last, *layout) : last.tree_pos;
        stream_.seekg(last.end_pos);
        Record next = read_descriptor(i);
        next.grid_pos = position();
        next.end_pos = size_;
        read_head(next);
        grids_.push_back(std::move(next));
    }
}

VdbTreeWalk VdbFile::walk_tree(const Record& record, const VdbValueLayout& layout) {
    limit_ = size_;
    stream_.seekg(record.tree_pos);
    return {static_cast<std::uint64_t>(record.end_pos - record.tree_pos), layout,
            [this](char* to, std::size_t count) { stream_.read(to, static_cast<std::streamsize>(count)); }};
}

std::int64_t VdbFile::end_of_tree(const Record& record, const VdbValueLayout& layout) {
    VdbTreeWalk walk = walk_tree(record, layout);
    walk.topology();
    while (!walk.next_buffers().begin.empty()) continue;
    return record.tree_pos + static_cast<std::int64_t>(walk.position());
}

openvdb::GridBase::Ptr VdbFile::read(const Record& record) {
    openvdb::GridBase::Ptr grid = read_voxels(record);
    if (record.parent.empty()) return grid;
    const auto parent = std::find_if(grids_.begin(), grids_.end(), [&](const Record& candidate) {
        return candidate.unique_name == record.parent && candidate.parent.empty();
    });
    if (parent == grids_.end())
        fail(path_, fmt::format("grid '{}' shares the voxels of '{}', which is not there",
                                record.shown_name(), GridDescriptor::nameAsString(record.parent)));
    grid->setTree(read_voxels(*parent)->baseTreePtr());
    return grid;
}

/// What `openvdb::io::Archive::readGrid` does, with the metadata and the transform that were read here, and a
/// tree that was checked.
openvdb::GridBase::Ptr VdbFile::read_voxels(const Record& record) {
    const std::optional<VdbValueLayout> layout = layout_of(record);
    if (!layout)
        fail(path_, fmt::format("grid '{}' is of type {}; only float, double, vec3s and vec3d can be read",
                                record.shown_name(), short_type(record.type)));
    if (!record.transform)
        fail(path_, fmt::format("the transform of grid '{}' cannot be read: {}", record.shown_name(),
                                record.transform_error));
    const openvdb::GridBase::Ptr grid = openvdb::GridBase::createGrid(record.type);
    grid->clearMetadata();
    grid->insertMeta(record.metadata);
    grid->setTransform(record.transform);
    if (!record.parent.empty()) return grid;

    VdbTreeWalk walk = walk_tree(record, *layout);
    read_vdb_tree(*grid, walk, {library_version_, file_version_, record.compression});
    return grid;
}

GridInfo describe(const Record& record) {
    GridInfo info;
    info.name = record.name();
    info.type = short_type(record.type);
    info.half = record.half;
    if (record.transform) {
        info.transform = transform_name(*record.transform);
        const double size = record.transform->isLinear() ? std::cbrt(record.transform->voxelVolume()) : 0.0;
        if (std::isfinite(size)) info.voxel_size = size;
    }
    const auto grid_class =
        record.metadata.getMetadata<openvdb::StringMetadata>(openvdb::GridBase::META_GRID_CLASS);
    info.grid_class = openvdb::GridBase::gridClassToString(
        grid_class ? openvdb::GridBase::stringToGridClass(grid_class->value()) : openvdb::GRID_UNKNOWN);
    const auto voxels =
        record.metadata.getMetadata<openvdb::Int64Metadata>(openvdb::GridBase::META_FILE_VOXEL_COUNT);
    if (voxels && voxels->value() >= 0) info.active_voxels = static_cast<std::size_t>(voxels->value());
    return info;
}

std::vector<GridInfo> describe_all(const std::vector<Record>& records) {
    std::vector<GridInfo> grids;
    std::map<std::string, int> seen;
    for (const Record& record : records) {
        grids.push_back(describe(record));
        grids.back().index = seen[grids.back().name]++;
    }
    for (GridInfo& grid : grids) {
        const bool plain = !grid.name.empty() && seen[grid.name] == 1;
        grid.label = printable(grid.name) + (plain ? "" : fmt::format("[{}]", grid.index));
    }
    return grids;
}

bool is_scalar(const GridInfo& grid) {
    return grid.type == "float" || grid.type == "double";
}
bool is_vector(const GridInfo& grid) {
    return grid.type == "vec3s" || grid.type == "vec3d";
}
bool is_level_set(const GridInfo& grid) {
    return grid.grid_class == "level set";
}

std::string lower_case(std::string text) {
    std::transform(text.begin(), text.end(), text.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return text;
}

std::string enumerate(const std::vector<GridInfo>& grids) {
    if (grids.empty()) return "it has no grids";
    std::string list;
    for (const GridInfo& grid : grids)
        list += fmt::format("{}{} ({}, {})", list.empty() ? "it has " : ", ", grid.label, grid.type,
                            grid.grid_class);
    return list;
}

/// The grid that goes by NAME or NAME[i].
GridInfo find_wanted(const std::vector<GridInfo>& grids, const std::string& wanted, const std::string& path) {
    std::vector<GridInfo> matches;
    for (const GridInfo& grid : grids) {
        if (grid.label == wanted || fmt::format("{}[{}]", grid.name, grid.index) == wanted) return grid;
        if (grid.name == wanted) matches.push_back(grid);
    }
    if (matches.size() == 1) return matches.front();
    if (matches.empty())
        throw InputError(fmt::format("'{}' has no grid '{}'; {}", path, printable(wanted), enumerate(grids)));
    throw InputError(fmt::format("'{}' has {} grids called '{}'; choose one as '{}'", path, matches.size(),
                                 printable(wanted), matches.front().label));
}

template <typename Predicate>
std::vector<GridInfo> select(const std::vector<GridInfo>& grids, const Predicate& predicate) {
    std::vector<GridInfo> selected;
    std::copy_if(grids.begin(), grids.end(), std::back_inserter(selected), predicate);
    return selected;
}

}  // namespace

void check_vdb_file(const std::string& path) {
    openvdb::initialize();
    guarded(path, [&] { VdbFile file(path); });
}

std::vector<GridInfo> list_grids(const std::string& path) {
    openvdb::initialize();
    return guarded(path, [&] {
        VdbFile file(path);
        file.find_streamed_grids();
        return describe_all(file.grids());
    });
}

GridInfo choose_grid(const std::vector<GridInfo>& grids, const std::optional<std::string>& wanted,
                     const std::string& path) {
    if (wanted) {
        const GridInfo grid = find_wanted(grids, *wanted, path);
        if (!is_scalar(grid))
            throw InputError(fmt::format("grid '{}' of '{}' is of type {}; a surface needs float or double",
                                         grid.label, path, grid.type));
        return grid;
    }
    const std::vector<GridInfo> scalars = select(grids, is_scalar);
    if (scalars.empty())
        throw InputError(
            fmt::format("'{}' has no grid of floats or doubles, so no surface; {}", path, enumerate(grids)));
    const std::vector<GridInfo> level_sets = select(scalars, is_level_set);
    if (level_sets.size() == 1) return level_sets.front();
    for (const char* name : {"surface", "phi", "sdf", "levelset", "distance"}) {
        const std::vector<GridInfo> named =
            select(scalars, [&](const GridInfo& grid) { return lower_case(grid.name) == name; });
        if (named.size() == 1) return named.front();
        const std::vector<GridInfo> named_level_sets = select(named, is_level_set);
        if (named_level_sets.size() == 1) return named_level_sets.front();
    }
    if (level_sets.empty() && scalars.size() == 1) return scalars.front();
    throw InputError(
        fmt::format("'{}' does not tell which of its grids is the surface; name one (--grid); {}", path,
                    enumerate(level_sets.empty() ? scalars : level_sets)));
}

std::optional<GridInfo> choose_velocity_grid(const std::vector<GridInfo>& grids,
                                             const std::optional<std::string>& wanted,
                                             const std::string& path) {
    if (wanted) {
        const GridInfo grid = find_wanted(grids, *wanted, path);
        if (!is_vector(grid))
            throw InputError(fmt::format("grid '{}' of '{}' is of type {}; a velocity needs vec3s or vec3d",
                                         grid.label, path, grid.type));
        return grid;
    }
    for (const char* name : {"v", "vel", "velocity"})
        for (const GridInfo& grid : grids)
            if (is_vector(grid) && lower_case(grid.name) == name) return grid;
    return std::nullopt;
}

openvdb::GridBase::Ptr read_grid(const std::string& path, const GridInfo& grid) {
    openvdb::initialize();
    return guarded(path, [&] {
        VdbFile file(path);
        file.find_streamed_grids();
        const std::vector<GridInfo> present = describe_all(file.grids());
        const auto found = std::find_if(present.begin(), present.end(), [&](const GridInfo& candidate) {
            return candidate.name == grid.name && candidate.index == grid.index;
        });
        if (found == present.end()) fail(path, fmt::format("it has no grid '{}'", grid.label));
        return file.read(file.grids()[static_cast<std::size_t>(found - present.begin())]);
    });
}

}  // namespace isotrack
