// Triangle meshes to and from files.
#pragma once

#include <string>

#include "isotrack/types.h"

namespace isotrack {

/// True for the extensions that `write_mesh` knows: ply, obj, off, stl, vtk (any case).
bool is_mesh_extension(const std::string& path);

/// Writes `mesh` by the extension of `path`, through a temporary name in the same folder and a rename. An empty mesh gives a valid
/// file without vertices. PLY is binary little-endian with float x y z, and, when the mesh has them, `int id` and float `vx vy vz`
/// per vertex; the other formats carry geometry alone. Coordinates are written as floats.
/// \throws IoError naming the path and the cause; OptionError for an unknown extension or an id beyond 2^31 - 1.
void write_mesh(const TriangleMesh& mesh, const std::string& path);

/// Reads any format OpenMesh reads, plus id and velocity from a PLY written by `write_mesh`. Polygons become fans; faces that would
/// make a complex edge are kept: the result is the file's face list, not a repaired mesh.
/// \throws IoError naming the path and the cause.
TriangleMesh read_mesh(const std::string& path);

}  // namespace isotrack
