#include "isotrack/surface/level_set.h"

#include <openvdb/tools/SignedFloodFill.h>
#include <openvdb/tools/ValueTransformer.h>
#include <openvdb/tools/VolumeToMesh.h>
#include <openvdb/tree/LeafManager.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "component_boxes.h"
#include "find_in_blocks.h"
#include "isotrack/error.h"
#include "surface/ambiguous_faces.h"
#include "surface/crossed_edges.h"
#include "surface/lattice_mesh.h"

namespace isotrack {
namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::FloatTree;
using Leaf = FloatTree::LeafNodeType;

// Of the trilinear value: with less the joined surface is near, which must do.
constexpr double kNoLess = 0.5;
constexpr double kFewNodes = 0.25;         // of the active ones
constexpr double kProjectionError = 1e-4;  // voxels; float values carry no more
constexpr double kFarVoxels = 10.0;        // values are clamped to this many voxels
constexpr double kInBand = 0.8;            // of its half width: interpolated values are right up to there
constexpr double kBeyondBand = 0.8;        // of it: distances are known as far beyond
constexpr int kCapLayers = 4;              // voxels added beyond a block whose border cuts the surface
constexpr double kMostCut = 0.6;           // of the crossings, by the end of the band: shreds otherwise
constexpr int kLeafDim = Leaf::DIM;

Vec3 to_eigen(const openvdb::Vec3d& v) {
    return {v.x(), v.y(), v.z()};
}

std::string grid_label(const openvdb::GridBase& grid) {
    return grid.getName().empty() ? "unnamed grid" : "grid '" + grid.getName() + "'";
}

struct AffineMap {
    Mat3 linear, inverse;
    Vec3 shift;
    double voxel_size;

    explicit AffineMap(const openvdb::GridBase& grid) {
        if (!grid.transform().isLinear())
            throw InputError(grid_label(grid) + " has a frustum transform; resample it to a linear one");
        shift = to_eigen(grid.indexToWorld(openvdb::Vec3d(0.0)));
        for (int axis = 0; axis < 3; ++axis) {
            openvdb::Vec3d unit(0.0);
            unit[axis] = 1.0;
            linear.col(axis) = to_eigen(grid.indexToWorld(unit)) - shift;
        }
        const double volume = std::abs(linear.determinant());
        if (!(volume > 0.0) || !std::isfinite(volume))
            throw InputError(grid_label(grid) + " has a transform that cannot be inverted");
        inverse = linear.inverse();
        const Vec3 edges = linear.colwise().norm();
        const bool uniform = edges.maxCoeff() - edges.minCoeff() <= 1e-9 * edges.maxCoeff();
        voxel_size = uniform ? edges[0] : std::cbrt(volume);
    }
    Vec3 to_world(const Vec3& index) const { return linear * index + shift; }
    Vec3 to_index(const Vec3& world) const { return inverse * (world - shift); }
    Vec3 gradient_to_world(const Vec3& index_gradient) const { return inverse.transpose() * index_gradient; }
};

/// Values at lattice nodes, through the leaves met lately: neighbouring leaves have places of their own.
class NodeValues {
public:
    explicit NodeValues(const FloatTree& tree) : tree_(tree) {}

    float at(const Coord& node) {
        constexpr int kMask = kLeafDim - 1;
        return leaf(node)[offset(node.x() & kMask, node.y() & kMask) + (node.z() & kMask)];
    }

    /// Those of N^3 nodes from `low` on. With N = 4 the columns at the corners of the first two axes are left
    /// out.
    template <int N>
    void block(const Coord& low, float (&v)[N][N][N]) {
        static_assert(N <= kLeafDim, "two leaves in a row hold all");
        const Coord in_leaf = low & (kLeafDim - 1);
        const float* leaves[2][2][2];
        for (int a = 0; a <= (in_leaf.x() + N > kLeafDim); ++a)
            for (int b = 0; b <= (in_leaf.y() + N > kLeafDim); ++b)
                for (int c = 0; c <= (in_leaf.z() + N > kLeafDim); ++c)
                    leaves[a][b][c] = leaf(low.offsetBy(kLeafDim * a, kLeafDim * b, kLeafDim * c));
        const int here = std::min(N, kLeafDim - in_leaf.z());  // of each column, in the first leaf
        for (int i = 0; i < N; ++i)
            for (int j = 0; j < N; ++j) {
                if (N == 4 && (i == 0 || i == 3) && (j == 0 || j == 3)) continue;
                const int x = in_leaf.x() + i, y = in_leaf.y() + j;
                const auto& column = leaves[x / kLeafDim][y / kLeafDim];
                const int at = offset(x % kLeafDim, y % kLeafDim);
                if (here == N) {
                    std::memcpy(v[i][j], column[0] + at + in_leaf.z(), sizeof v[i][j]);
                } else {
                    for (int k = 0; k < here; ++k) v[i][j][k] = column[0][at + in_leaf.z() + k];
                    for (int k = here; k < N; ++k) v[i][j][k] = column[1][at + k - here];
                }
            }
    }

private:
    struct Place {
        const float* values = nullptr;
        Coord leaf;                     // in leaves
        std::unique_ptr<float[]> tile;  // as many values as a leaf has, all the same
    };

    /// The values of the leaf that holds a node, or would.
    const float* leaf(const Coord& node) {
        const Coord at = node >> static_cast<int>(Leaf::LOG2DIM);
        Place& place = places_[((at.x() & 3) << 4) | ((at.y() & 3) << 2) | (at.z() & 3)];
        if (!place.values || place.leaf != at) fetch(node, at, place);
        return place.values;
    }
    void fetch(const Coord& node, const Coord& at, Place& place) {
        place.leaf = at;
        if (const Leaf* found = tree_.probeConstLeaf(node)) {
            place.values = found->buffer().data();
            return;
        }
        if (!place.tile) place.tile = std::make_unique<float[]>(Leaf::SIZE);
        std::fill_n(place.tile.get(), Leaf::SIZE, tree_.getValue(node));
        place.values = place.tile.get();
    }
    static int offset(int x, int y) { return (x * kLeafDim + y) * kLeafDim; }

    const FloatTree& tree_;
    Place places_[64];
};

/// Values around one lattice cell. The cell's corners are (0..1)^3; the values one further out in each axis
/// are those that the central differences at the corners need.
class Stencil {
public:
    explicit Stencil(const FloatTree& tree) : nodes_(tree) {}

    /// Of an ambiguous cell also without what joins its nodes, where that is farther on the same side, by up
    /// to twice.
    struct Value {
        double joined, farther;
    };
    Value value(const Vec3& index) {
        Vec3 t;
        const Coord base = split(index, t);
        float v[2][2][2];
        nodes_.block(base, v);
        const auto mix = [](double a, double b, double s) { return a + s * (b - a); };
        double planes[2];
        for (int i = 0; i < 2; ++i)
            planes[i] = mix(mix(v[i][0][0], v[i][0][1], t.z()), mix(v[i][1][0], v[i][1][1], t.z()), t.y());
        const double trilinear = mix(planes[0], planes[1], t.x());
        if (!has_ambiguous_face(v)) return {trilinear, trilinear};
        const double joined =
            trilinear +
            joining_correction([&](int i, int j, int k) { return nodes_.at(base.offsetBy(i, j, k)); }, t);
        return {joined, is_farther(trilinear, joined) ? trilinear : joined};
    }

    /// Trilinear value, and the trilinear interpolation of the central differences at the corners, per voxel.
    Surface::Sample sample(const Vec3& index) {
        Vec3 t;
        const Coord base = split(index, t);
        float v[4][4][4];  // v[i + 1][j + 1][k + 1] at base + (i, j, k)
        nodes_.block(base.offsetBy(-1), v);
        const double w[3][2] = {{1.0 - t.x(), t.x()}, {1.0 - t.y(), t.y()}, {1.0 - t.z(), t.z()}};
        Surface::Sample result{0.0, Vec3::Zero()};
        for (int a = 0; a < 2; ++a)
            for (int b = 0; b < 2; ++b) {
                const double xy = w[0][a] * w[1][b], yz = w[1][a] * w[2][b], xz = w[0][a] * w[2][b];
                const float* line = v[a + 1][b + 1];
                result.value += xy * (w[2][0] * line[1] + w[2][1] * line[2]);
                result.gradient.z() += xy * (w[2][0] * (line[2] - line[0]) + w[2][1] * (line[3] - line[1]));
                result.gradient.x() += yz * (w[0][0] * (v[2][a + 1][b + 1] - v[0][a + 1][b + 1]) +
                                             w[0][1] * (v[3][a + 1][b + 1] - v[1][a + 1][b + 1]));
                result.gradient.y() += xz * (w[1][0] * (v[a + 1][2][b + 1] - v[a + 1][0][b + 1]) +
                                             w[1][1] * (v[a + 1][3][b + 1] - v[a + 1][1][b + 1]));
            }
        result.gradient *= 0.5;
        const float corners[2][2][2] = {{{v[1][1][1], v[1][1][2]}, {v[1][2][1], v[1][2][2]}},
                                        {{v[2][1][1], v[2][1][2]}, {v[2][2][1], v[2][2][2]}}};
        if (has_ambiguous_face(corners))
            result.value +=
                joining_correction([&](int i, int j, int k) { return v[i + 1][j + 1][k + 1]; }, t);
        return result;
    }

private:
    static bool is_farther(double trilinear, double joined) {
        return (joined < 0.0) == (trilinear < 0.0) && std::abs(trilinear) > std::abs(joined) &&
               std::abs(joined) > kNoLess * std::abs(trilinear);
    }
    static bool has_ambiguous_face(const float (&corners)[2][2][2]) {
        unsigned inside = 0;
        for (unsigned c = 0; c < 8; ++c)
            inside |= static_cast<unsigned>(corners[c >> 2][c >> 1 & 1][c & 1] < 0.0f) << c;
        return kHasAmbiguousFace[inside];
    }
    static Coord split(const Vec3& index, Vec3& t) {
        // Points far outside any grid, or not finite, read the background at a corner of the representable
        // range.
        constexpr double kLimit = 1 << 30;
        Coord base;
        for (int axis = 0; axis < 3; ++axis) {
            double x = index[axis];
            if (!(std::abs(x) < kLimit)) x = x < 0.0 && std::isfinite(x) ? -kLimit : kLimit;
            const int towards_zero = static_cast<int>(x);
            base[axis] = towards_zero - (x < towards_zero);
            t[axis] = x - base[axis];
        }
        return base;
    }

    NodeValues nodes_;
};

/// Length of the world gradient at the surface, away from the border; 0 when there is nothing to measure.
struct Slope {
    double median = 0.0, mean = 0.0;
};

Slope slope_at_surface(const FloatTree& tree, const AffineMap& map,
                       const std::vector<CrossedEdge>& crossings) {
    constexpr std::size_t kSamples = 4000;
    Stencil stencil(tree);
    std::vector<double> slopes;
    const std::size_t step = 1 + crossings.size() / kSamples;
    for (int pass = 0; pass < 2 && slopes.empty(); ++pass)  // the border only when there is nothing else
        for (std::size_t i = 0; i < crossings.size(); i += step) {
            if (pass == 0 && crossings[i].at_border) continue;
            const double slope = map.gradient_to_world(stencil.sample(crossings[i].index()).gradient).norm();
            if (std::isfinite(slope) && slope > 0.0) slopes.push_back(slope);
        }
    if (slopes.empty()) return {};
    constexpr double kSteepest = 10.0;  // medians: next to a value that was not finite it may be anything
    std::vector<double> ranked = slopes;
    const auto middle = ranked.begin() + static_cast<std::ptrdiff_t>(ranked.size() / 2);
    std::nth_element(ranked.begin(), middle, ranked.end());
    const double median = *middle;
    double sum = 0.0;
    for (const double slope : slopes) sum += std::min(slope, kSteepest * median);
    return {median, sum / static_cast<double>(slopes.size())};
}

/// World units per grid unit for a measured slope: exact where the unit is recognised.
double value_scale_for(double slope, double voxel_size, bool level_set) {
    // Central differences across sheets of a voxel or two are too short: what says it holds distances is
    // believed for longer.
    const double recognised = std::log(level_set ? 2.5 : 1.25);
    if (!(slope > 0.0)) return 1.0;
    const double off_world = std::abs(std::log(slope)), off_voxels = std::abs(std::log(slope * voxel_size));
    if (std::min(off_world, off_voxels) > recognised) return 1.0 / slope;
    return off_world <= off_voxels ? 1.0 : voxel_size;
}

/// A float copy with `sign * (value - iso)`, active tiles turned into voxels, and no value that is not
/// finite.
template <typename GridType>
FloatGrid::Ptr float_copy(const GridType& source, double iso, double sign) {
    using Value = typename GridType::ValueType;
    const auto convert = [=](Value v) {
        const double shifted = sign * (static_cast<double>(v) - iso);
        if (std::isnan(shifted)) return std::numeric_limits<float>::max();
        return static_cast<float>(std::clamp<double>(shifted, std::numeric_limits<float>::lowest(),
                                                     std::numeric_limits<float>::max()));
    };
    const auto voxels = source.deepCopy();
    voxels->tree().voxelizeActiveTiles();
    auto copy = FloatGrid::create(convert(source.background()));
    copy->setTransform(source.transform().copy());
    copy->setTree(
        std::make_shared<FloatTree>(voxels->tree(), convert(source.background()), openvdb::TopologyCopy()));
    const auto source_accessor = source.getConstAccessor();
    openvdb::tree::LeafManager<FloatTree> leaves(copy->tree());
    leaves.foreach ([&](Leaf& leaf, std::size_t) {
        auto reader = source.getConstUnsafeAccessor();
        float* data = leaf.buffer().data();
        for (openvdb::Index i = 0; i < Leaf::SIZE; ++i)
            data[i] = convert(reader.getValue(leaf.offsetToGlobalCoord(i)));
    });
    // Inactive tiles keep the sign they had.
    for (auto tile = copy->tree().beginValueOff(); tile; ++tile)
        if (!tile.isVoxelValue()) tile.setValue(convert(source_accessor.getValue(tile.getCoord())));
    return copy;
}

/// A dense block whose background says nothing: adds voxels around it so that the surface goes straight on
/// past the block's last voxels and is cut by a flat cap one voxel beyond them.
void cap_block(FloatGrid& grid, const openvdb::CoordBBox& block, double voxel) {
    const auto outer =
        openvdb::CoordBBox(block.min().offsetBy(-kCapLayers), block.max().offsetBy(kCapLayers));
    const FloatGrid::ConstPtr inside = grid.deepCopy();
    auto accessor = grid.getAccessor();
    const auto reader = inside->getConstAccessor();
    for (auto c = outer.begin(); c; ++c) {
        Coord nearest = *c;
        nearest.minComponent(block.max());
        nearest.maxComponent(block.min());
        // Distance to the cap in voxels: negative in front of it.
        int depth = std::numeric_limits<int>::min();
        for (int axis = 0; axis < 3; ++axis) {
            const int past_top = (*c)[axis] - block.max()[axis] - 1,
                      past_bottom = block.min()[axis] - 1 - (*c)[axis];
            depth = std::max({depth, past_top, past_bottom});
        }
        const float cap = static_cast<float>(depth * voxel);
        if (depth < -kCapLayers) continue;
        accessor.setValue(*c, std::max(reader.getValue(nearest), cap));
    }
}

}  // namespace

struct LevelSet::Impl {
    AffineMap map;
    FloatGrid::ConstPtr grid;
    double scale = 1.0;
    double band = 0.0, slope = 1.0;  // half width of the band
    std::size_t active_voxels = 0, border_crossings = 0;
    openvdb::GridBase::ConstPtr source;  // as it came
    CrossedEdges crossed;
    Box bounds;

    Impl(const openvdb::GridBase::ConstPtr& as_it_came, const LevelSetOptions& options)
        : map(*as_it_came), source(as_it_came) {
        const auto floats = openvdb::gridConstPtrCast<FloatGrid>(source);
        const auto doubles = openvdb::gridConstPtrCast<openvdb::DoubleGrid>(source);
        if (!floats && !doubles)
            throw InputError(grid_label(*source) + " holds " + source->valueType() +
                             " values, not float or double distances");
        active_voxels = source->activeVoxelCount();
        const auto grid_class = source->getGridClass();
        const bool fog = grid_class == openvdb::GRID_FOG_VOLUME;
        if (fog && options.iso == 0.0)
            throw InputError(
                grid_label(*source) +
                " is a fog volume, not a level set; give the density of the surface as iso value");
        if (active_voxels == 0 && grid_class != openvdb::GRID_LEVEL_SET)
            throw InputError(grid_label(*source) + " has no voxels and is of class '" +
                             openvdb::GridBase::gridClassToString(grid_class) + "', not a level set");

        const double sign = fog ? -1.0 : 1.0;
        const bool plain = floats && options.iso == 0.0 && !fog && is_plain(*floats);
        FloatGrid::Ptr own;
        if (!plain) {
            own = floats ? float_copy(*floats, options.iso, sign) : float_copy(*doubles, options.iso, sign);
            grid = own;
        } else {
            grid = floats;
        }

        CrossedEdges found = find_crossed_edges(grid->constTree());
        if (found.edges.empty() && active_voxels > 0 && grid_class != openvdb::GRID_LEVEL_SET)
            throw InputError(
                grid_label(*source) + " is not a level set: its values do not change sign around " +
                std::to_string(options.iso) + " (class '" + openvdb::GridBase::gridClassToString(grid_class) +
                "'); give an iso value inside its range");
        refuse_beyond_band(options.iso, found);
        const Slope in_grid_units = slope_at_surface(grid->constTree(), map, found.edges);
        scale = value_scale_for(in_grid_units.median, map.voxel_size, grid_class == openvdb::GRID_LEVEL_SET);
        if (in_grid_units.mean > 0.0) slope = std::min(1.0, scale * in_grid_units.mean);
        border_crossings = static_cast<std::size_t>(
            std::count_if(found.edges.begin(), found.edges.end(), [](const auto& c) { return c.at_border; }));

        if (!own && scale != 1.0) grid = own = floats->deepCopy();
        if (own) {
            normalise(*own, source->getGridClass());
            found = find_crossed_edges(own->constTree());
        }
        const double background = grid->background();
        band = std::clamp(background, map.voxel_size, kFarVoxels * map.voxel_size);
        crossed = std::move(found);
        bounds = tbb::parallel_reduce(
            tbb::blocked_range<std::size_t>(0, crossed.edges.size(), 4096), Box(),
            [&](const auto& range, Box box) {
                for (std::size_t e = range.begin(); e < range.end(); ++e)
                    box.extend(map.to_world(crossed.edges[e].index()));
                return box;
            },
            [](const Box& a, const Box& b) { return a.merged(b); });
    }

    /// \throws InputError where the band ends before the iso value: the surface would be the band's.
    void refuse_beyond_band(double iso, const CrossedEdges& found) const {
        if (iso == 0.0 || active_voxels == 0 || source->getGridClass() != openvdb::GRID_LEVEL_SET) return;
        const double end = grid->background() + iso;
        const auto cut = std::count_if(found.edges.begin(), found.edges.end(),
                                       [](const CrossedEdge& edge) { return edge.at_border; });
        if ((end > 0.0 && std::abs(iso) >= end) ||
            static_cast<double>(cut) > kMostCut * static_cast<double>(found.edges.size()))
            throw InputError(grid_label(*source) + " has no room in its band for the iso value " +
                             std::to_string(iso) + ": the background is " + std::to_string(end) +
                             "; give one nearer to 0, or make the band wider");
    }

    bool is_active(const Coord& c) const {
        const auto floats = openvdb::gridConstPtrCast<FloatGrid>(source);
        return floats ? floats->tree().isValueOn(c)
                      : openvdb::gridConstPtrCast<openvdb::DoubleGrid>(source)->tree().isValueOn(c);
    }

    /// A float grid that can be sampled as it is, once its values are known to be world distances.
    static bool is_plain(const FloatGrid& grid) {
        const float background = grid.background();
        if (!(background > 0.0f) || !std::isfinite(background) || grid.tree().activeTileCount() > 0)
            return false;
        openvdb::tree::LeafManager<const FloatTree> leaves(grid.constTree());
        std::atomic<bool> finite{true};
        leaves.foreach ([&](const Leaf& leaf, std::size_t) {
            const float* data = leaf.buffer().data();
            float sum =
                0.0f;  // stays finite unless a value is not; leaves hold too few values to overflow otherwise
            for (openvdb::Index i = 0; i < Leaf::SIZE; ++i) sum += data[i] * 0.0f;
            if (!(sum == 0.0f)) finite = false;
        });
        return finite;
    }

    /// World units, clamped, signs everywhere.
    void normalise(FloatGrid& own, openvdb::GridClass) {
        const float far = static_cast<float>(kFarVoxels * map.voxel_size);
        const float factor = static_cast<float>(scale);
        const float old_background = own.background();
        // Zero stays zero and means outside: a block's background of 0 is mended below.
        const auto convert = [=](float v) { return std::clamp(v * factor, -far, far); };
        openvdb::tree::LeafManager<FloatTree> leaves(own.tree());
        leaves.foreach ([&](Leaf& leaf, std::size_t) {
            float* data = leaf.buffer().data();
            for (openvdb::Index i = 0; i < Leaf::SIZE; ++i) data[i] = convert(data[i]);
        });
        for (auto tile = own.tree().beginValueOff(); tile; ++tile)
            if (!tile.isVoxelValue()) tile.setValue(convert(tile.getValue()));

        const bool silent = !(old_background > 0.0f);
        const float background = silent ? static_cast<float>(3.0 * map.voxel_size) : convert(old_background);
        if (silent) {
            const auto block = own.evalActiveVoxelBoundingBox();
            const bool dense = own.activeVoxelCount() == block.volume();
            set_outside(own, background);
            if (dense && !block.empty())
                cap_block(own, block, map.voxel_size);
            else
                openvdb::tools::signedFloodFill(own.tree());
        } else if (background != old_background) {
            own.tree().root().setBackground(background, /*updateChildNodes=*/false);
        }
        own.setGridClass(openvdb::GRID_LEVEL_SET);
    }

    /// Gives every inactive voxel and tile the value `outside`.
    static void set_outside(FloatGrid& own, float outside) {
        for (auto value = own.tree().beginValueOff(); value; ++value) value.setValue(outside);
        own.tree().root().setBackground(outside, /*updateChildNodes=*/false);
    }
};

namespace {

/// The diagonal of the face that an edge and the one along the axis `other` span from the lower end of the
/// edge, if all four of the face's edges are crossed. `other` is above the edge's axis: each face once.
std::optional<Surface::Diagonal> diagonal_beyond(const CrossedEdge& edge, int other, NodeValues& nodes,
                                                 const AffineMap& map) {
    const auto corner = [&](int out, int u, int w) {
        Coord c = edge.from;
        c[edge.axis] += u;
        c[other] += w;
        c[3 - edge.axis - other] += out;
        return c;
    };
    const auto value = [&](int out, int u, int w) { return nodes.at(corner(out, u, w)); };
    const auto is_inside = [&](int out, int u, int w) { return value(out, u, w) < 0.0f; };
    if (is_inside(0, 0, 1) == edge.outward || is_inside(0, 1, 1) != edge.outward) return std::nullopt;
    const int turned = !edge.outward;
    const bool joined = joins_diagonal(
        [&](int side, int u, int w) { return is_inside(side == 0 ? -1 : 1, turned ? 1 - u : u, w); });
    const int first = joined ? turned : 1 - turned;  // the joined nodes are (first, 0) and (1 - first, 1)
    const auto place = [&](int u, int w) {
        const Coord c = corner(0, u, w);
        return map.to_world(Vec3(c.x(), c.y(), c.z()));
    };
    Surface::Diagonal diagonal{place(first, 0), place(1 - first, 1), {}};
    const Vec3 middle = 0.5 * (diagonal.from + diagonal.to);
    const double between = 0.5 * (value(0, first, 0) + value(0, 1 - first, 1));
    for (int w = 0; w < 2; ++w) {
        const int u = w == 0 ? 1 - first : first;
        diagonal.beside[w] = middle + between / (between - value(0, u, w)) * (place(u, w) - middle);
    }
    return diagonal;
}

class GridProbe final : public Surface::Probe {
public:
    GridProbe(const FloatTree& tree, const AffineMap& map, double band)
        : Probe(kProjectionError * map.voxel_size, map.voxel_size), map_(map), stencil_(tree), band_(band) {}

    double value(const Vec3& p) override { return stencil_.value(map_.to_index(p)).joined; }
    double farther_value(const Vec3& p) override {
        const double value = stencil_.value(map_.to_index(p)).farther;
        return std::abs(value) < kInBand * band_ ? value : beyond_band(p, value);
    }

    Surface::Sample sample(const Vec3& p) override {
        Surface::Sample s = stencil_.sample(map_.to_index(p));
        s.gradient = map_.gradient_to_world(s.gradient);
        return s;
    }

private:
    /// Beyond the band values are all alike. There the distance is that to a point in the band and its value,
    /// no less than the true one; least where that point lies on the shortest way, which its gradient
    /// tells. Where the band is not near it is as far as distances are known.
    double beyond_band(const Vec3& p, double value) {
        constexpr double kLeastSlope = 0.05;
        const double side = value < 0.0 ? -1.0 : 1.0;
        const double length = kBeyondBand * band_;
        double distance = length + band_;
        const auto value_at = [&](const Vec3& q) {
            return std::abs(stencil_.value(map_.to_index(q)).farther);
        };
        const auto try_at = [&](const Vec3& q) {
            const double there = value_at(q);
            if (!(there < kInBand * band_ && length + there < distance)) return false;
            distance = length + there;
            return true;
        };
        const auto aim_from = [&](const Vec3& from) {
            constexpr int kAims = 2;
            Vec3 gradient = sample(from).gradient;
            bool any = false;
            for (int aim = 0; aim < kAims && gradient.norm() > kLeastSlope; ++aim) {
                const Vec3 q = p - side * length * gradient.normalized();
                if (!try_at(q)) break;
                any = true;
                if (aim + 1 < kAims) gradient = sample(q).gradient;
            }
            return any;
        };
        // Next to the band some nodes of it are around; else it is looked for.
        if (!aim_from(p)) {
            Vec3 nearest = p;
            double least = band_;
            for (int axis = 0; axis < 3; ++axis)
                for (const double step : {-length, length}) {
                    const Vec3 q = p + step * Vec3::Unit(axis);
                    const double there = value_at(q);
                    if (!(there < least)) continue;
                    least = there;
                    nearest = q;
                }
            if (least < kInBand * band_) distance = length + least;
            aim_from(nearest);
        }
        return side * distance;
    }

    const AffineMap& map_;
    Stencil stencil_;
    const double band_;
};

}  // namespace

LevelSet::LevelSet(openvdb::GridBase::ConstPtr grid, const LevelSetOptions& options) {
    if (!grid) throw InputError("a level set needs a grid, got none");
    impl_ = std::make_unique<const Impl>(grid, options);
}
LevelSet::~LevelSet() = default;

std::unique_ptr<Surface::Probe> LevelSet::probe() const {
    return std::make_unique<GridProbe>(impl_->grid->constTree(), impl_->map, impl_->band);
}
double LevelSet::resolution() const {
    return impl_->map.voxel_size;
}
double LevelSet::reach() const {
    return (kInBand + kBeyondBand) * impl_->band;
}
double LevelSet::slope() const {
    return impl_->slope;
}
Box LevelSet::bounds() const {
    return impl_->bounds;
}
Eigen::Affine3d LevelSet::lattice() const {
    Eigen::Affine3d result;
    result.linear() = impl_->map.linear;
    result.translation() = impl_->map.shift;
    return result;
}
bool LevelSet::at_border(const Vec3& p) const {
    if (impl_->border_crossings == 0) return false;
    const Vec3 index = impl_->map.to_index(p);
    const Coord low(openvdb::math::Floor(index.x()), openvdb::math::Floor(index.y()),
                    openvdb::math::Floor(index.z()));
    for (int corner = 0; corner < 8; ++corner)
        if (!impl_->is_active(low.offsetBy(corner & 1, corner >> 1 & 1, corner >> 2))) return true;
    return false;
}
namespace {

/// The edge in voxels, a power of two, of the largest cube that is no longer than `length`; from 1 to `most`.
int cube_within(double length, double voxel, int most = kLeafDim) {
    int cube = 1;
    while (cube < most && 2 * cube * voxel <= length) cube *= 2;
    return cube;
}

/// Crossed edges as crossings.
class ToCrossing {
public:
    explicit ToCrossing(const AffineMap& map) : map_(map) {
        for (int axis = 0; axis < 3; ++axis) along_[axis] = map.linear.col(axis).normalized().cast<float>();
    }
    Surface::Crossing operator()(const CrossedEdge& edge) const {
        return {map_.to_world(edge.index()), (edge.outward ? 1.0f : -1.0f) * along_[edge.axis]};
    }

private:
    const AffineMap& map_;
    Eigen::Vector3f along_[3];
};

}  // namespace

Surface::CrossingSequence LevelSet::crossing_sequence(double apart) const {
    constexpr double kFlat = 4.01;  // of `apart`: cubes where the surface may be flat
    constexpr int kWidest = 64;     // voxels
    const std::vector<CrossedEdge>& edges = impl_->crossed.edges;
    const ToCrossing crossing(impl_->map);
    if (const int cube = cube_within(apart, resolution()); cube > 1) {
        std::vector<StandIn> some =
            thin_out(impl_->crossed, cube, cube_within(kFlat * apart, resolution(), kWidest));
        const std::size_t size = some.size();
        return {size, [&edges, crossing, chosen = std::move(some)](std::size_t i) {
                    Crossing result = crossing(edges[chosen[i].edge]);
                    result.stands_for = chosen[i].stands_for;
                    result.flat = chosen[i].flat;
                    return result;
                }};
    }
    return {edges.size(), [&edges, crossing](std::size_t i) { return crossing(edges[i]); }};
}
std::vector<Surface::Crossing> LevelSet::crossings_near(const std::vector<Vec3>& places, double reach) const {
    std::vector<Vec3> middles;
    for (const Vec3& place : places) middles.push_back(impl_->map.to_index(place));
    // Along any of the lattice's axes.
    const double voxels = lattice().inverse().linear().cwiseAbs().rowwise().sum().maxCoeff() * reach;
    std::vector<Crossing> result;
    const ToCrossing crossing(impl_->map);
    for (const std::size_t e : edges_near(impl_->crossed, middles, voxels, cube_within(reach, resolution())))
        result.push_back(crossing(impl_->crossed.edges[e]));
    return result;
}
namespace {

/// What `add(edge, found)` finds at the edges, in their order. `make_add()`: one for each block of them.
template <typename Found, typename MakeAdd>
std::vector<Found> gather(const std::vector<CrossedEdge>& edges, const MakeAdd& make_add) {
    constexpr std::size_t kBlock = 16384;
    return find_in_blocks<Found>(edges.size(), kBlock,
                                 [&](std::size_t begin, std::size_t end, std::vector<Found>& found) {
                                     auto add = make_add();
                                     for (std::size_t e = begin; e < end; ++e) add(edges[e], found);
                                 });
}

}  // namespace

std::vector<Eigen::Vector3i> LevelSet::upright_crossings() const {
    return gather<Eigen::Vector3i>(impl_->crossed.edges, [] {
        return [](const CrossedEdge& edge, std::vector<Eigen::Vector3i>& found) {
            if (edge.axis == 2) found.emplace_back(edge.from.x(), edge.from.y(), edge.from.z());
        };
    });
}
std::optional<long> LevelSet::lattice_euler() const {
    // A vertex for each part of a cell, a quadrangle for each crossed edge, and two edges for every
    // quadrangle.
    return impl_->crossed.cell_parts - static_cast<long>(impl_->crossed.edges.size());
}
std::optional<std::vector<Box>> LevelSet::lattice_components() const {
    std::vector<openvdb::Vec3s> points;
    std::vector<openvdb::Vec4I> quads;
    openvdb::tools::volumeToMesh(*impl_->grid, points, quads);
    return component_boxes<4>(points, quads);
}
TriangleMesh LevelSet::lattice_mesh(const std::vector<Vec3>& places, double reach) const {
    // Around few places their nodes alone are looked at, and two more to each side.
    const Vec3 most = lattice().inverse().linear().cwiseAbs() * Vec3::Constant(reach) + Vec3::Constant(2.0);
    FloatGrid::Ptr grid;
    if (static_cast<double>(places.size()) * (2.0 * most + Vec3::Ones()).prod() <
        kFewNodes * static_cast<double>(impl_->active_voxels)) {
        grid = impl_->grid->copyWithNewTree();
        auto to = grid->getAccessor();
        const auto from = impl_->grid->getConstAccessor();
        for (const Vec3& place : places) {
            const Vec3 middle = lattice().inverse() * place;
            const auto corner = [&](double side) {
                const Vec3 p = (middle + side * most).array().round();
                return Coord(static_cast<int>(p.x()), static_cast<int>(p.y()), static_cast<int>(p.z()));
            };
            for (auto node = openvdb::CoordBBox(corner(-1.0), corner(1.0)).begin(); node; ++node)
                to.setValue(*node, from.getValue(*node));
        }
    } else {
        grid = impl_->grid->deepCopy();
    }
    openvdb::tools::foreach (grid->beginValueOn(), [this](const FloatGrid::ValueOnIter& value) {
        value.setValue(off_node(*value, static_cast<float>(impl_->map.voxel_size)));
    });
    return lattice_mesh_of(quadrangles_near(places, reach, volume_to_polygons(*grid, 0.0)), *this);
}

std::vector<Surface::Diagonal> LevelSet::diagonals() const {
    return gather<Diagonal>(impl_->crossed.edges, [this] {
        return [this, nodes = NodeValues(impl_->grid->constTree())](const CrossedEdge& edge,
                                                                    std::vector<Diagonal>& found) mutable {
            for (int other = edge.axis + 1; other < 3; ++other)
                if ((edge.saddles >> other & 1) != 0)
                    if (const auto diagonal = diagonal_beyond(edge, other, nodes, impl_->map))
                        found.push_back(*diagonal);
        };
    });
}
bool LevelSet::empty() const {
    return impl_->crossed.edges.empty();
}
std::size_t LevelSet::active_voxels() const {
    return impl_->active_voxels;
}
double LevelSet::value_scale() const {
    return impl_->scale;
}
std::size_t LevelSet::crossing_count() const {
    return impl_->crossed.edges.size();
}
std::size_t LevelSet::border_crossings() const {
    return impl_->border_crossings;
}
openvdb::FloatGrid::ConstPtr LevelSet::grid() const {
    return impl_->grid;
}

}  // namespace isotrack
