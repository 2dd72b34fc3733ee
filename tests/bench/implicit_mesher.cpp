#include <CGAL/Complex_2_in_triangulation_3.h>
#include <CGAL/Implicit_surface_3.h>
#include <CGAL/Surface_mesh_default_criteria_3.h>
#include <CGAL/Surface_mesh_default_triangulation_3.h>
#include <CGAL/make_surface_mesh.h>

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <unordered_map>

#include "bench/peer_meshers.h"
#include "isotrack/error.h"

namespace isotrack::bench {
namespace {

using Triangulation = CGAL::Surface_mesh_default_triangulation_3;
using Complex = CGAL::Complex_2_in_triangulation_3<Triangulation>;
using Kernel = Triangulation::Geom_traits;
using Point = Kernel::Point_3;

constexpr double kAngleBound = 30.0;      // degrees; refinement is proven to end up to here
constexpr double kOracleError = 1e-3;     // voxels, of the points put on the surface
constexpr std::size_t kFirstPoints = 20;  // per component, CGAL's own default
constexpr std::size_t kMostFirstPoints = 1280;
constexpr std::size_t kMostCalls = 400'000'000;  // of the oracle; then it is given up

Point to_cgal(const Vec3& p) {
    return {p.x(), p.y(), p.z()};
}
Vec3 from_cgal(const Point& p) {
    return {p.x(), p.y(), p.z()};
}

/// The used vertices of each component, ascending.
std::vector<std::vector<int>> components_of(const TriangleMesh& mesh) {
    std::vector<int> parent(mesh.points.size());
    std::iota(parent.begin(), parent.end(), 0);
    const auto root = [&](int v) {
        while (parent[v] != v) v = parent[v] = parent[parent[v]];
        return v;
    };
    std::vector<char> used(mesh.points.size(), 0);
    for (const Triangle& t : mesh.triangles)
        for (const int v : t) {
            used[v] = 1;
            parent[root(v)] = root(t[0]);
        }
    std::map<int, std::vector<int>> by_root;
    for (int v = 0; v < static_cast<int>(used.size()); ++v)
        if (used[v]) by_root[root(v)].push_back(v);
    std::vector<std::vector<int>> result;
    for (auto& [first, vertices] : by_root) result.push_back(std::move(vertices));
    return result;
}

/// `count` of the vertices, each the farthest from those before.
std::vector<int> spread(const TriangleMesh& mesh, const std::vector<int>& vertices, std::size_t count) {
    std::vector<double> distance(vertices.size(), std::numeric_limits<double>::infinity());
    std::vector<int> result;
    for (std::size_t next = 0; result.size() < std::min(count, vertices.size());) {
        result.push_back(vertices[next]);
        for (std::size_t i = 0; i < vertices.size(); ++i)
            distance[i] =
                std::min(distance[i], (mesh.points[vertices[i]] - mesh.points[vertices[next]]).squaredNorm());
        next =
            static_cast<std::size_t>(std::max_element(distance.begin(), distance.end()) - distance.begin());
    }
    return result;
}

/// A facet of the complex crosses the surface on the dual edge of its two cells, one of which is inside.
TriangleMesh triangles_of(const Complex& complex, Surface::Probe& probe) {
    const Triangulation& dt = complex.triangulation();
    TriangleMesh result;
    std::unordered_map<const void*, int> numbers;
    const auto number = [&](const Triangulation::Vertex_handle& v) {
        const auto [it, fresh] = numbers.try_emplace(&*v, static_cast<int>(result.points.size()));
        if (fresh) result.points.push_back(from_cgal(v->point()));
        return it->second;
    };
    const auto inside = [&](const Triangulation::Cell_handle& cell) {
        return !dt.is_infinite(cell) && probe.value(from_cgal(dt.dual(cell))) < 0.0;
    };
    for (auto f = complex.facets_begin(); f != complex.facets_end(); ++f) {
        const auto facet = inside(f->first) ? *f : dt.mirror_facet(*f);
        Triangle corners;
        for (int k = 0; k < 3; ++k)  // CGAL counts counter-clockwise seen from inside the cell
            corners[2 - k] = number(facet.first->vertex(Triangulation::vertex_triple_index(facet.second, k)));
        result.triangles.push_back(corners);
    }
    return result;
}

}  // namespace

ImplicitMesher::ImplicitMesher(const LevelSet& level_set, const TriangleMesh& uniform)
    : level_set_(level_set), uniform_(uniform), components_(components_of(uniform)) {}

TriangleMesh ImplicitMesher::mesh(double distance) const {
    const auto probe = level_set_.probe();
    std::size_t calls = 0;
    const auto value = [&](const Point& p) {
        if (++calls > kMostCalls) throw Error("make_surface_mesh does not end");
        return probe->value(from_cgal(p));
    };
    const Box box = level_set_.bounds();
    const double radius = 0.6 * box.diagonal().norm() + 2.0 * level_set_.voxel_size();
    const CGAL::Implicit_surface_3<Kernel> surface(value, {to_cgal(box.center()), radius * radius},
                                                   kOracleError * level_set_.voxel_size() / radius);
    const CGAL::Surface_mesh_default_criteria_3<Triangulation> criteria(kAngleBound, 2.0 * radius, distance);

    // A component none of whose first points is on a facet was not found: it gets more of them.
    std::vector<std::size_t> counts(components_.size(), kFirstPoints);
    for (;;) {
        Triangulation dt;
        Complex complex(dt);
        std::vector<std::vector<Triangulation::Vertex_handle>> first(components_.size());
        for (std::size_t c = 0; c < components_.size(); ++c)
            for (const int v : spread(uniform_, components_[c], counts[c]))
                if (const auto p = probe->project(uniform_.points[v]))
                    first[c].push_back(dt.insert(to_cgal(*p)));
        CGAL::make_surface_mesh(complex, surface, criteria, CGAL::Manifold_tag(), /*initial points:*/ 0);

        bool complete = true;
        for (std::size_t c = 0; c < components_.size(); ++c) {
            const bool found = std::any_of(first[c].begin(), first[c].end(),
                                           [&](const auto& v) { return complex.is_in_complex(v); });
            if (found || counts[c] >= std::min(components_[c].size(), kMostFirstPoints)) continue;
            counts[c] *= 4;
            complete = false;
        }
        if (complete) return triangles_of(complex, *probe);
    }
}

}  // namespace isotrack::bench
