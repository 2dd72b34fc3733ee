#include "isotrack/surface/level_set.h"

#include <openvdb/tools/Count.h>
#include <openvdb/tree/LeafManager.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <mutex>

#include "find_in_blocks.h"
#include "isotrack/error.h"
#include "surface/affine_map.h"
#include "surface/ambiguous_faces.h"
#include "surface/chosen_edges.h"
#include "surface/crossed_components.h"
#include "surface/crossed_edges.h"
#include "surface/grid_part.h"
#include "surface/grid_probe.h"
#include "surface/grid_values.h"
#include "surface/inactive_tiles.h"
#include "surface/lattice_mesh.h"

namespace isotrack {
namespace {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::FloatTree;

constexpr double kLeastBand = 0.1;  // voxels
constexpr double kMostCut = 0.6;    // of the crossings, by the end of the band: shreds otherwise

/// Length of the world gradient at the surface, away from the border; 0 when there is nothing to measure.
struct Slope {
    double median = 0.0, mean = 0.0;
};

Slope slope_at_surface(const FloatTree& tree, const AffineMap& map, const CrossedEdges& crossings) {
    constexpr std::size_t kSamples = 4000, kBlock = 256;
    const std::size_t step = 1 + crossings.size() / kSamples;
    const auto slopes_of = [&](bool at_border) {
        return find_in_blocks<double>(
            (crossings.size() + step - 1) / step, kBlock,
            [&](std::size_t begin, std::size_t end, std::vector<double>& found) {
                Stencil stencil(tree);
                for (std::size_t n = begin; n < end; ++n) {
                    const CrossedEdge edge = crossings[n * step];
                    if (edge.at_border && !at_border) continue;
                    const double slope =
                        map.gradient_to_world(stencil.sample(edge.index()).gradient).norm();
                    if (std::isfinite(slope) && slope > 0.0) found.push_back(slope);
                }
            });
    };
    std::vector<double> slopes = slopes_of(false);
    if (slopes.empty()) slopes = slopes_of(true);  // the border only when there is nothing else
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

/// How deep inside values are known: less than what inactive nodes there have for a value. Infinite where
/// there are none.
double depth_inside(const FloatTree& tree) {
    using Leaf = FloatTree::LeafNodeType;
    constexpr openvdb::Index kLast = Leaf::DIM - 1;
    constexpr double kNone = std::numeric_limits<double>::infinity();
    const auto depth = [](float value) { return value < 0.0f ? -static_cast<double>(value) : kNone; };
    const auto least = [](double a, double b) { return std::min(a, b); };
    const openvdb::tree::LeafManager<const FloatTree> leaves(tree);
    double result = tbb::parallel_reduce(
        leaves.leafRange(), kNone,
        [&](const auto& range, double so_far) {
            for (auto leaf = range.begin(); leaf; ++leaf)
                for (openvdb::Index corner = 0; corner < 8;
                     ++corner) {  // one of them is where any is, nearly always
                    const openvdb::Index n = ((corner >> 2) * kLast << 2 * Leaf::LOG2DIM) |
                                             ((corner >> 1 & 1) * kLast << Leaf::LOG2DIM) |
                                             (corner & 1) * kLast;
                    if (!leaf->isValueOn(n)) so_far = least(so_far, depth(leaf->getValue(n)));
                }
            return so_far;
        },
        least);
    for_each_inactive_tile(tree, [&](float value) { result = least(result, depth(value)); });
    return result;
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
    LeafTable leaves;
    Box bounds;

    /// Of the whole lattice mesh, made when it is asked for.
    const PolygonMesh& all_quadrangles() const;
    bool has_quadrangles() const { return has_quadrangles_; }

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
        CrossedEdges found;
        if (plain) found = find_crossed_edges(floats->constTree());
        if (!plain || !found.finite()) {
            own = floats ? float_copy(*floats, options.iso, sign) : float_copy(*doubles, options.iso, sign);
            found = find_crossed_edges(own->constTree());
        }
        grid = own ? FloatGrid::ConstPtr(own) : floats;

        if (found.empty() && active_voxels > 0 && grid_class != openvdb::GRID_LEVEL_SET)
            throw InputError(
                grid_label(*source) + " is not a level set: its values do not change sign around " +
                std::to_string(options.iso) + " (class '" + openvdb::GridBase::gridClassToString(grid_class) +
                "'); give an iso value inside its range");
        const Slope in_grid_units = slope_at_surface(grid->constTree(), map, found);
        refuse_beyond_band(options.iso, found, in_grid_units.median * map.voxel_size);
        scale = value_scale_for(in_grid_units.median, map.voxel_size, grid_class == openvdb::GRID_LEVEL_SET);
        if (!std::isfinite(static_cast<float>(scale)))
            throw InputError(
                grid_label(*source) +
                " has values that hardly differ from voxel to voxel at its surface; multiply them to be "
                "distances");
        if (in_grid_units.mean > 0.0) slope = std::min(1.0, scale * in_grid_units.mean);
        border_crossings = found.at_border();

        if (!own && scale != 1.0) grid = own = floats->deepCopy();
        if (own) {
            to_world_distances(*own, scale, map.voxel_size);
            found = find_crossed_edges(own->constTree());
        }
        // The inside of a fog volume is active, and all of one density.
        const double inside =
            fog ? -openvdb::tools::minMax(grid->tree()).min() : depth_inside(grid->constTree());
        band = map.voxel_size * std::clamp(std::min<double>(grid->background(), inside) / map.voxel_size,
                                           kLeastBand, kFarVoxels);
        crossed = std::move(found);
        leaves = LeafTable(grid->constTree());
        bounds = tbb::parallel_reduce(
            tbb::blocked_range<std::size_t>(0, crossed.size(), 4096), Box(),
            [&](const auto& range, Box box) {
                crossed.for_each_in(range.begin(), range.end(),
                                    [&](const CrossedEdge& edge) { box.extend(map.to_world(edge.index())); });
                return box;
            },
            [](const Box& a, const Box& b) { return a.merged(b); });
    }

    /// \throws InputError where the band ends before the iso value: the surface would be the band's.
    /// `step`: how much values change in a voxel, about.
    void refuse_beyond_band(double iso, const CrossedEdges& found, double step) const {
        constexpr double kNear = 1.5;  // steps
        if (iso == 0.0 || active_voxels == 0 || source->getGridClass() != openvdb::GRID_LEVEL_SET) return;
        const double end = grid->background() + iso;  // outside; that inside is not known
        if (!(end > 0.0)) return;
        // Where it runs into the border of a block, values jump.
        const auto reader = grid->getConstAccessor();
        const auto is_cut = [&](const CrossedEdge& edge) {
            if (!edge.at_border) return false;
            Coord to = edge.from;
            ++to[edge.axis];
            return std::abs(reader.getValue(is_active(edge.from) ? to : edge.from)) < kNear * step;
        };
        std::size_t cut = 0;
        found.for_each_in(0, found.size(), [&](const CrossedEdge& edge) { cut += is_cut(edge); });
        if (iso >= end || (found.empty() && -iso >= end) ||
            static_cast<double>(cut) > kMostCut * static_cast<double>(found.size()))
            throw InputError(grid_label(*source) + " has no room in its band for the iso value " +
                             std::to_string(iso) + ": the background is " + std::to_string(end) +
                             "; give one nearer to 0, or make the band wider");
    }

    bool is_active(const Coord& c) const {
        const auto floats = openvdb::gridConstPtrCast<FloatGrid>(source);
        return floats ? floats->tree().isValueOn(c)
                      : openvdb::gridConstPtrCast<openvdb::DoubleGrid>(source)->tree().isValueOn(c);
    }

private:
    mutable std::once_flag once_;
    mutable PolygonMesh quadrangles_;
    mutable std::atomic<bool> has_quadrangles_ = false;
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

}  // namespace

LevelSet::LevelSet(openvdb::GridBase::ConstPtr grid, const LevelSetOptions& options) {
    if (!grid) throw InputError("a level set needs a grid, got none");
    impl_ = std::make_unique<const Impl>(grid, options);
}
LevelSet::~LevelSet() = default;

std::unique_ptr<Surface::Probe> LevelSet::probe() const {
    return std::make_unique<GridProbe>(impl_->grid->constTree(), impl_->leaves, impl_->map, impl_->band);
}
double LevelSet::resolution() const {
    return impl_->map.voxel_size;
}
double LevelSet::reach() const {
    return GridProbe::reach(impl_->band);
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

/// The edge in voxels, a power of two, of the largest cube that is no longer than about `length`; from 1 to
/// `most`.
int cube_within(double length, double voxel, int most = FloatTree::LeafNodeType::DIM) {
    constexpr double kRounded = 1.001;  // lengths may be given in few digits
    int cube = 1;
    while (cube < most && 2 * cube * voxel <= kRounded * length) cube *= 2;
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
    const CrossedEdges& edges = impl_->crossed;
    const ToCrossing crossing(impl_->map);
    if (const int cube = cube_within(apart, resolution()); cube > 1) {
        std::vector<StandIn> some =
            thin_out(impl_->crossed, cube, cube_within(kFlat * apart, resolution(), kWidest));
        const std::size_t size = some.size();
        return {size, [&edges, crossing, chosen = std::move(some)](std::size_t first, std::size_t end,
                                                                   Crossing* to) {
                    for (; first < end; ++first, ++to) {
                        *to = crossing(edges[chosen[first].edge]);
                        to->stands_for = static_cast<std::int16_t>(chosen[first].stands_for);
                        to->flat = chosen[first].flat;
                    }
                }};
    }
    return {edges.size(), [&edges, crossing](std::size_t first, std::size_t end, Crossing* to) {
                edges.for_each_in(first, end, [&](const CrossedEdge& edge) { *to++ = crossing(edge); });
            }};
}
std::vector<Surface::Crossing> LevelSet::crossings_near(const std::vector<Vec3>& places, double reach) const {
    std::vector<Vec3> middles;
    for (const Vec3& place : places) middles.push_back(impl_->map.to_index(place));
    // Along any of the lattice's axes.
    const double voxels = lattice().inverse().linear().cwiseAbs().rowwise().sum().maxCoeff() * reach;
    std::vector<Crossing> result;
    const ToCrossing crossing(impl_->map);
    for (const std::size_t e : edges_near(impl_->crossed, middles, voxels, cube_within(reach, resolution())))
        result.push_back(crossing(impl_->crossed[e]));
    return result;
}
namespace {

/// What `add(edge, found)` finds at the edges, in their order. `make_add()`: one for each block of them.
template <typename Found, typename MakeAdd>
std::vector<Found> gather(const CrossedEdges& edges, const MakeAdd& make_add) {
    constexpr std::size_t kBlock = 16384;
    return find_in_blocks<Found>(
        edges.size(), kBlock, [&](std::size_t begin, std::size_t end, std::vector<Found>& found) {
            auto add = make_add();
            edges.for_each_in(begin, end, [&](const CrossedEdge& edge) { add(edge, found); });
        });
}

}  // namespace

std::vector<Eigen::Vector3i> LevelSet::upright_crossings() const {
    return gather<Eigen::Vector3i>(impl_->crossed, [] {
        return [](const CrossedEdge& edge, std::vector<Eigen::Vector3i>& found) {
            if (edge.axis == 2) found.emplace_back(edge.from.x(), edge.from.y(), edge.from.z());
        };
    });
}
std::optional<long> LevelSet::lattice_euler() const {
    // A vertex for each part of a cell, a quadrangle for each crossed edge, and two edges for every
    // quadrangle.
    return impl_->crossed.cell_parts() - static_cast<long>(impl_->crossed.size());
}
std::optional<std::size_t> LevelSet::lattice_component_count() const {
    return count_components(impl_->grid->constTree());
}
namespace {

/// volumeToMesh's, of values `off_node`; those of `grid` change.
PolygonMesh quadrangles_of(FloatGrid& grid, float voxel_size) {
    openvdb::tree::LeafManager<FloatTree>(grid.tree()).foreach ([&](auto& leaf, std::size_t) {
        for (auto value = leaf.beginValueOn(); value; ++value) value.setValue(off_node(*value, voxel_size));
    });
    auto tile = grid.tree().beginValueOn();
    for (tile.setMaxDepth(FloatTree::ValueOnIter::LEAF_DEPTH - 1); tile; ++tile)
        tile.setValue(off_node(*tile, voxel_size));
    return volume_to_polygons(grid, 0.0);
}

}  // namespace

const PolygonMesh& LevelSet::Impl::all_quadrangles() const {
    std::call_once(once_, [this] {
        // Whoever makes them must not take up another task meanwhile that asks for them, too.
        tbb::this_task_arena::isolate(
            [this] { quadrangles_ = quadrangles_of(*grid->deepCopy(), static_cast<float>(map.voxel_size)); });
        has_quadrangles_ = true;
    });
    return quadrangles_;
}
std::optional<std::vector<Box>> LevelSet::lattice_components() const {
    return boxes_of_components(impl_->grid->constTree(), impl_->map);
}
TriangleMesh LevelSet::lattice_mesh(const std::vector<Vec3>& places, double reach) const {
    if (!impl_->has_quadrangles()) {
        // Two nodes more to each side: those of a cell at the end, and those beyond, which tell how it is
        // joined.
        const Vec3 nodes =
            lattice().inverse().linear().cwiseAbs() * Vec3::Constant(reach) + Vec3::Constant(2.0);
        std::vector<Vec3> middles;
        for (const Vec3& place : places) middles.push_back(impl_->map.to_index(place));
        if (const FloatGrid::Ptr part = part_around(*impl_->grid, middles, nodes))
            return lattice_mesh_of(
                quadrangles_near(places, reach,
                                 quadrangles_of(*part, static_cast<float>(impl_->map.voxel_size))),
                *this);
    }
    return lattice_mesh_of(quadrangles_near(places, reach, impl_->all_quadrangles()), *this);
}

TriangleMesh LevelSet::light_lattice_mesh(double close) const {
    return light_lattice_mesh_of(impl_->all_quadrangles(), *this, close);
}

std::vector<Surface::Diagonal> LevelSet::diagonals() const {
    return gather<Diagonal>(impl_->crossed, [this] {
        return [this, nodes = NodeValues(impl_->grid->constTree(), &impl_->leaves)](
                   const CrossedEdge& edge, std::vector<Diagonal>& found) mutable {
            for (int other = edge.axis + 1; other < 3; ++other)
                if ((edge.saddles >> other & 1) != 0)
                    if (const auto diagonal = diagonal_beyond(edge, other, nodes, impl_->map))
                        found.push_back(*diagonal);
        };
    });
}
bool LevelSet::empty() const {
    return impl_->crossed.empty();
}
std::size_t LevelSet::active_voxels() const {
    return impl_->active_voxels;
}
double LevelSet::value_scale() const {
    return impl_->scale;
}
std::size_t LevelSet::crossing_count() const {
    return impl_->crossed.size();
}
std::size_t LevelSet::border_crossings() const {
    return impl_->border_crossings;
}
openvdb::FloatGrid::ConstPtr LevelSet::grid() const {
    return impl_->grid;
}

}  // namespace isotrack
