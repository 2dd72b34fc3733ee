// Tracks a sphere that grows, with the installed headers and library. Calls into the parts of the archive
// that need OpenVDB, CGAL, OpenMesh and the JSON writer, so that a library missing from the package's
// dependencies fails here, at the link.
#include <isotrack/compare/metrics.h>
#include <isotrack/error.h>
#include <isotrack/io/mesh_file.h>
#include <isotrack/io/run_report.h>
#include <isotrack/io/vdb_file.h>
#include <isotrack/meshing/mesh_topology.h>
#include <isotrack/surface/shapes.h>
#include <isotrack/tracking/tracker.h>

#include <cmath>
#include <cstdio>
#include <string>

int main() {
    using namespace isotrack;
    constexpr double kTolerance = 0.01;

    TrackerOptions options;
    options.tolerance = kTolerance;
    Tracker tracker(options);
    TriangleMesh mesh;
    for (const double radius : {1.0, 1.05, 1.1}) {
        const auto sphere = shapes::sphere(Vec3::Zero(), radius, 0.05);
        mesh = tracker.advance(*sphere).mesh;
        const MeshTopology topology = mesh_topology(mesh);
        if (!topology.closed() || !topology.manifold() || topology.euler != 2) {
            std::fprintf(stderr, "the mesh of a sphere of radius %g is no sphere\n", radius);
            return 1;
        }
        for (const Vec3& point : mesh.points)
            if (std::abs(point.norm() - radius) > kTolerance) {
                std::fprintf(stderr, "a vertex lies %g from the sphere of radius %g\n",
                             std::abs(point.norm() - radius), radius);
                return 1;
            }
    }

    write_mesh(mesh, "sphere.ply");
    if (read_mesh("sphere.ply").triangles.size() != mesh.triangles.size()) return 1;
    if (to_json(FrameReport{}).empty()) return 1;
    try {
        list_grids("sphere.ply");
        return 1;  // a PLY file must be refused
    } catch (const IoError& error) {
        std::printf("refused, as it should be: %s\n", error.what());
    }
    std::printf("%zu triangles\n", mesh.triangles.size());
    return 0;
}
