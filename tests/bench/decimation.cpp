#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <OpenMesh/Tools/Decimater/DecimaterT.hh>
#include <OpenMesh/Tools/Decimater/ModNormalFlippingT.hh>
#include <OpenMesh/Tools/Decimater/ModQuadricT.hh>

#include "bench/peer_meshers.h"

namespace isotrack::bench {
namespace {

struct Doubles : OpenMesh::DefaultTraits {
    using Point = OpenMesh::Vec3d;
    using Normal = OpenMesh::Vec3d;
};
using Mesh = OpenMesh::TriMesh_ArrayKernelT<Doubles>;

/// Where the half-edges cannot hold a triangle, because the mesh is not manifold, it gets vertices of its
/// own.
Mesh to_openmesh(const TriangleMesh& mesh) {
    Mesh result;
    std::vector<Mesh::VertexHandle> handles;
    handles.reserve(mesh.points.size());
    const auto add = [&](const Vec3& p) { return result.add_vertex({p.x(), p.y(), p.z()}); };
    for (const Vec3& p : mesh.points) handles.push_back(add(p));
    for (const auto& [a, b, c] : mesh.triangles)
        if (!result.add_face(handles[a], handles[b], handles[c]).is_valid())
            result.add_face(add(mesh.points[a]), add(mesh.points[b]), add(mesh.points[c]));
    return result;
}

TriangleMesh from_openmesh(const Mesh& mesh) {
    TriangleMesh result;
    for (const auto v : mesh.vertices()) {
        const auto& p = mesh.point(v);
        result.points.emplace_back(p[0], p[1], p[2]);
    }
    for (const auto f : mesh.faces()) {
        Triangle corners;
        int k = 0;
        for (const auto v : mesh.fv_range(f)) corners[k++] = v.idx();
        result.triangles.push_back(corners);
    }
    return result;
}

}  // namespace

TriangleMesh decimate(const TriangleMesh& mesh, std::size_t triangles) {
    using Decimater = OpenMesh::Decimater::DecimaterT<Mesh>;
    Mesh work = to_openmesh(mesh);
    work.request_vertex_status();
    work.request_edge_status();
    work.request_face_status();
    work.request_face_normals();
    work.update_face_normals();
    Decimater decimater(work);
    OpenMesh::Decimater::ModQuadricT<Mesh>::Handle quadric;
    decimater.add(quadric);
    decimater.module(quadric).unset_max_err();
    // Alone, the quadrics of flat parts let triangles fold over.
    OpenMesh::Decimater::ModNormalFlippingT<Mesh>::Handle no_flips;
    decimater.add(no_flips);
    decimater.initialize();
    decimater.decimate_to_faces(0, triangles);
    work.garbage_collection();
    return from_openmesh(work);
}

}  // namespace isotrack::bench
