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

/// Reads PLY, OBJ, OFF and STL, plus id and velocity from a PLY as `write_mesh` makes it. Polygons become fans; degenerate faces and
/// those that would make a complex edge are kept: the result is the file's face list, not a repaired mesh. Only the corners of STL,
/// which has no indices, are merged where they are equal.
/// \throws IoError naming the path and the cause.
TriangleMesh read_mesh(const std::string& path);

}  // namespace isotrack
