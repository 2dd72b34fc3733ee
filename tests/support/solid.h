// Whether a mesh bounds a solid.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>

#include "isotrack/meshing/mesh_topology.h"
#include "isotrack/meshing/self_intersections.h"

namespace isotrack::support {

inline void expect_solid(const TriangleMesh& mesh, std::size_t components, long euler) {
    const MeshTopology t = mesh_topology(mesh);
    EXPECT_TRUE(t.closed());
    EXPECT_TRUE(t.oriented());
    EXPECT_TRUE(t.manifold());
    EXPECT_EQ(t.unused_vertices, 0u);
    EXPECT_EQ(t.components, components);
    EXPECT_EQ(t.euler, euler);
    EXPECT_EQ(self_intersections(mesh).size(), 0u);
}

}  // namespace isotrack::support
