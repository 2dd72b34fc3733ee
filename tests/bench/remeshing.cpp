#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/remesh.h>
#include <CGAL/Surface_mesh.h>

#include "bench/peer_meshers.h"
#include "isotrack/error.h"

namespace isotrack::bench {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;

Mesh to_cgal(const TriangleMesh& mesh) {
    Mesh result;
    for (const Vec3& p : mesh.points) result.add_vertex({p.x(), p.y(), p.z()});
    using Index = Mesh::Vertex_index;
    for (const auto& [a, b, c] : mesh.triangles)
        if (result.add_face(Index(a), Index(b), Index(c)) == Mesh::null_face())
            throw InputError("isotropic remeshing takes manifold meshes only");
    return result;
}

TriangleMesh from_cgal(const Mesh& mesh) {
    TriangleMesh result;
    for (const auto v : mesh.vertices()) {
        const auto& p = mesh.point(v);
        result.points.emplace_back(p.x(), p.y(), p.z());
    }
    for (const auto f : mesh.faces()) {
        Triangle corners;
        int k = 0;
        for (const auto v : mesh.vertices_around_face(mesh.halfedge(f)))
            corners[k++] = static_cast<int>(v.idx());
        result.triangles.push_back(corners);
    }
    return result;
}

}  // namespace

TriangleMesh remesh(const TriangleMesh& mesh, double edge) {
    constexpr unsigned kIterations = 5;
    Mesh work = to_cgal(mesh);
    namespace pmp = CGAL::Polygon_mesh_processing;
    pmp::isotropic_remeshing(work.faces(), edge, work, pmp::parameters::number_of_iterations(kIterations));
    work.collect_garbage();
    return from_cgal(work);
}

}  // namespace isotrack::bench
