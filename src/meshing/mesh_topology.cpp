#include "isotrack/meshing/mesh_topology.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

#include "disjoint_sets.h"
#include "isotrack/error.h"

namespace isotrack {
namespace {

constexpr double kDegrees = 57.295779513082320876798154814105;
// Fixed, because it decides where sums are cut: the same bits at any thread count.
constexpr std::size_t kGrain = 2048;

bool is_degenerate(const Triangle& t) {
    return t[0] == t[1] || t[1] == t[2] || t[2] == t[0];
}

/// The corners (3 * triangle + position) of each vertex, those of vertex v from `begin[v]` to `begin[v + 1]`,
/// ascending. Degenerate triangles have none.
struct VertexCorners {
    std::vector<int> begin, corner;
};

VertexCorners corners_by_vertex(const TriangleMesh& mesh) {
    VertexCorners result;
    result.begin.assign(mesh.points.size() + 1, 0);
    for (const Triangle& t : mesh.triangles)
        if (!is_degenerate(t))
            for (int v : t) ++result.begin[v + 1];
    std::partial_sum(result.begin.begin(), result.begin.end(), result.begin.begin());
    result.corner.resize(result.begin.back());
    std::vector<int> next(result.begin.begin(), result.begin.end() - 1);
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
        if (const Triangle& t = mesh.triangles[i]; !is_degenerate(t))
            for (int k = 0; k < 3; ++k) result.corner[next[t[k]]++] = static_cast<int>(3 * i) + k;
    return result;
}

struct Counts {
    std::size_t vertices = 0, edges = 0, border = 0, complex = 0, flipped = 0, pinched = 0;

    Counts operator+(const Counts& b) const {
        return {vertices + b.vertices, edges + b.edges,     border + b.border,
                complex + b.complex,   flipped + b.flipped, pinched + b.pinched};
    }
};

/// Looks at one vertex after the other; keeps its buffers between them.
class Fans {
public:
    Fans(const TriangleMesh& mesh, const VertexCorners& corners) : mesh_(mesh), corners_(corners) {}

    void count(int v, Counts& counts) {
        const int begin = corners_.begin[v], degree = corners_.begin[v + 1] - begin;
        if (degree == 0) return;
        ++counts.vertices;

        spokes_.clear();
        parent_.resize(degree);
        for (int i = 0; i < degree; ++i) {
            const int corner = corners_.corner[begin + i], k = corner % 3;
            const Triangle& t = mesh_.triangles[corner / 3];
            add_spoke({t[(k + 1) % 3], i, true});
            add_spoke({t[(k + 2) % 3], i, false});
            parent_[i] = i;
        }
        if (degree > kInsertionLimit)
            std::sort(spokes_.begin(), spokes_.end(),
                      [](const Spoke& a, const Spoke& b) { return a.other < b.other; });

        int fans = degree;
        for (std::size_t first = 0, last; first < spokes_.size(); first = last) {
            const Spoke& spoke = spokes_[first];
            for (last = first + 1; last < spokes_.size() && spokes_[last].other == spoke.other; ++last)
                fans -= join(spoke.triangle, spokes_[last].triangle);
            if (spoke.other < v) continue;  // counted at its other end
            ++counts.edges;
            const std::size_t uses = last - first;
            if (uses == 1)
                ++counts.border;
            else if (uses > 2)
                ++counts.complex;
            else if (spoke.leaves == spokes_[first + 1].leaves)
                ++counts.flipped;
        }
        if (fans > 1) ++counts.pinched;
    }

private:
    // The vertex's edges as its triangles see them. Few of them: kept sorted as they come, which beats
    // std::sort.
    static constexpr int kInsertionLimit = 16;
    struct Spoke {
        int other;     // vertex at the far end
        int triangle;  // position among the triangles of this vertex
        bool leaves;   // the triangle runs along it away from this vertex
    };

    void add_spoke(const Spoke& spoke) {
        spokes_.push_back(spoke);
        if (parent_.size() > kInsertionLimit) return;
        std::size_t i = spokes_.size() - 1;
        for (; i > 0 && spokes_[i - 1].other > spoke.other; --i) spokes_[i] = spokes_[i - 1];
        spokes_[i] = spoke;
    }

    int root(int i) {
        while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
        return i;
    }

    int join(int a, int b) {
        a = root(a), b = root(b);
        parent_[b] = a;
        return a != b;
    }

    const TriangleMesh& mesh_;
    const VertexCorners& corners_;
    std::vector<Spoke> spokes_;
    std::vector<int> parent_;
};

std::size_t count_components(const TriangleMesh& mesh, std::size_t used_vertices) {
    DisjointSets vertices(mesh.points.size());
    std::size_t components = used_vertices;
    for (const Triangle& t : mesh.triangles) {
        if (is_degenerate(t)) continue;
        for (int k = 1; k < 3; ++k) components -= vertices.join(t[0], t[k]);
    }
    return components;
}

void require_valid_indices(const TriangleMesh& mesh) {
    const auto points = mesh.points.size();
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
        for (int v : mesh.triangles[i])
            if (v < 0 || static_cast<std::size_t>(v) >= points)
                throw InputError("triangle " + std::to_string(i) + " names vertex " + std::to_string(v) +
                                 " of a mesh with " + std::to_string(points) + " vertices");
}

}  // namespace

MeshTopology mesh_topology(const TriangleMesh& mesh) {
    require_valid_indices(mesh);
    const VertexCorners corners = corners_by_vertex(mesh);
    const Counts counts = tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, mesh.points.size(), kGrain), Counts{},
        [&](const tbb::blocked_range<std::size_t>& range, Counts sum) {
            Fans fans(mesh, corners);
            for (std::size_t v = range.begin(); v != range.end(); ++v) fans.count(static_cast<int>(v), sum);
            return sum;
        },
        std::plus<>());

    MeshTopology result;
    result.vertices = counts.vertices;
    result.unused_vertices = mesh.points.size() - counts.vertices;
    result.edges = counts.edges;
    result.triangles = mesh.triangles.size();
    result.components = count_components(mesh, counts.vertices);
    result.border_edges = counts.border;
    result.complex_edges = counts.complex;
    result.flipped_edges = counts.flipped;
    result.pinched_vertices = counts.pinched;
    const std::size_t proper = corners.corner.size() / 3;
    result.degenerate_triangles = mesh.triangles.size() - proper;
    result.euler =
        static_cast<long>(counts.vertices) - static_cast<long>(counts.edges) + static_cast<long>(proper);
    return result;
}

std::vector<double> smallest_angles(const TriangleMesh& mesh) {
    std::vector<double> result(mesh.triangles.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, result.size(), kGrain),
                      [&](const tbb::blocked_range<std::size_t>& range) {
                          for (std::size_t i = range.begin(); i != range.end(); ++i) {
                              const Triangle& t = mesh.triangles[i];
                              const Vec3 edge[3] = {mesh.points[t[1]] - mesh.points[t[0]],
                                                    mesh.points[t[2]] - mesh.points[t[1]],
                                                    mesh.points[t[0]] - mesh.points[t[2]]};
                              // The smallest angle lies opposite the shortest edge.
                              int shortest = 0;
                              for (int k = 1; k < 3; ++k)
                                  if (edge[k].squaredNorm() < edge[shortest].squaredNorm()) shortest = k;
                              const Vec3 &a = edge[(shortest + 1) % 3], &b = edge[(shortest + 2) % 3];
                              const double twice_area = a.cross(b).norm();
                              result[i] =
                                  twice_area > 0.0 ? std::atan2(twice_area, -a.dot(b)) * kDegrees : 0.0;
                          }
                      });
    return result;
}

double enclosed_volume(const TriangleMesh& mesh) {
    if (mesh.empty()) return 0.0;
    // Tetrahedra from a point near the mesh, so that a mesh far from the origin loses no digits.
    const Vec3 apex = mesh.points[mesh.triangles.front()[0]];
    return tbb::parallel_deterministic_reduce(
        tbb::blocked_range<std::size_t>(0, mesh.triangles.size(), kGrain), 0.0,
        [&](const tbb::blocked_range<std::size_t>& range, double sum) {
            for (std::size_t i = range.begin(); i != range.end(); ++i) {
                const Triangle& t = mesh.triangles[i];
                const Vec3 a = mesh.points[t[0]] - apex, b = mesh.points[t[1]] - apex,
                           c = mesh.points[t[2]] - apex;
                sum += a.dot(b.cross(c)) / 6.0;
            }
            return sum;
        },
        std::plus<>());
}

}  // namespace isotrack
