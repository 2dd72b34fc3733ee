#include "io/vdb_tree_read.h"

#include <openvdb/io/io.h>
#include <openvdb/tree/LeafManager.h>
#include <tbb/parallel_for.h>

#include <istream>
#include <memory>
#include <stdexcept>
#include <streambuf>
#include <string_view>

namespace isotrack {
namespace {

constexpr std::size_t kLeaves = 64;  // about, at the same time by one thread

/// Lets a stream read from memory without a copy.
class MemoryBuffer : public std::streambuf {
public:
    explicit MemoryBuffer(std::string_view bytes) {
        char* begin = const_cast<char*>(bytes.data());  // a get area is never written to
        setg(begin, begin, begin + bytes.size());
    }

private:
    pos_type seekoff(off_type offset, std::ios_base::seekdir direction, std::ios_base::openmode) override {
        const off_type from = direction == std::ios_base::beg   ? 0
                              : direction == std::ios_base::cur ? gptr() - eback()
                                                                : egptr() - eback();
        return seekpos(from + offset, std::ios_base::in);
    }
    pos_type seekpos(pos_type position, std::ios_base::openmode) override {
        if (off_type(position) < 0 || off_type(position) > egptr() - eback()) return pos_type(off_type(-1));
        setg(eback(), eback() + off_type(position), egptr());
        return position;
    }
};

/// The bytes as OpenVDB wants them. For one thread.
class TreeStream {
public:
    TreeStream(std::string_view bytes, const openvdb::GridBase& grid, const VdbTreeFormat& format)
        : buffer_(bytes), stream_(&buffer_), metadata_(std::make_shared<openvdb::io::StreamMetadata>()) {
        stream_.exceptions(std::ios::failbit | std::ios::badbit | std::ios::eofbit);
        openvdb::io::setStreamMetadataPtr(stream_, metadata_, false);
        openvdb::io::setVersion(stream_, format.openvdb_version, format.file_version);
        openvdb::io::setDataCompression(stream_, format.compression);
        openvdb::io::setGridClass(stream_, grid.getGridClass());
        openvdb::io::setGridBackgroundValuePtr(stream_, nullptr);
        metadata_->setSeekable(true);
        metadata_->setHalfFloat(grid.saveFloatAsHalf());
    }
    std::istream& get() { return stream_; }

private:
    MemoryBuffer buffer_;
    std::istream stream_;
    openvdb::io::StreamMetadata::Ptr metadata_;  // the stream keeps a pointer to this pointer
};

}  // namespace

void read_vdb_tree(openvdb::GridBase& grid, VdbTreeWalk& walk, const VdbTreeFormat& format) {
    grid.readTopology(TreeStream(walk.topology(), grid, format).get());
    const auto read_leaves = [&](auto& typed) {
        auto& tree = typed.tree();
        const openvdb::tree::LeafManager leaves(tree);
        const std::size_t count = leaves.leafCount();
        if (count != walk.leaf_count()) throw std::runtime_error("its tree has other leaves than it says");
        const bool half = grid.saveFloatAsHalf();
        std::size_t first = 0;  // of the next buffers
        const auto read_next = [&](const VdbTreeWalk::Buffers& buffers) {
            for (std::size_t n = 0; n < buffers.begin.size(); ++n) leaves.leaf(first + n).buffer().allocate();
            tbb::parallel_for(tbb::blocked_range<std::size_t>(0, buffers.begin.size(), kLeaves),
                              [&](const auto& range) {
                                  TreeStream stream(buffers.bytes, grid, format);
                                  openvdb::io::setGridBackgroundValuePtr(stream.get(), &tree.background());
                                  for (std::size_t n = range.begin(); n < range.end(); ++n) {
                                      stream.get().seekg(static_cast<std::streamoff>(buffers.begin[n]));
                                      leaves.leaf(first + n).readBuffers(stream.get(), half);
                                  }
                              });
            first += buffers.begin.size();
        };
        while (first < count) read_next(walk.next_buffers());
    };
    using Grids =
        openvdb::TypeList<openvdb::FloatGrid, openvdb::DoubleGrid, openvdb::Vec3SGrid, openvdb::Vec3DGrid>;
    if (!grid.apply<Grids>(read_leaves)) throw std::runtime_error("grids of its type cannot be read");
}

}  // namespace isotrack
