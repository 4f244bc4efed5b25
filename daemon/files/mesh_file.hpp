// Meshes for other programs: PLY, STL, OBJ.
#pragma once

#include <filesystem>

#include "algo/types/point_cloud.hpp"

namespace plumb {

/// Binary STL, metres: triangles with the normals of their planes; no colours in this format.
/// @throws std::invalid_argument for a triangle whose vertex is not there; IoError.
void WriteMeshStl(const std::filesystem::path& path, const TriangleMesh& mesh);

/// OBJ, metres: vertices (with colours after the coordinates where there are any), vertex normals,
/// faces.
/// @throws as WriteMeshStl().
void WriteMeshObj(const std::filesystem::path& path, const TriangleMesh& mesh);

/// Writes by the name's ending: .ply, .stl or .obj (either case), whole or not at all.
/// @throws std::invalid_argument for another ending; IoError.
void WriteMeshFile(const std::filesystem::path& path, const TriangleMesh& mesh);

}  // namespace plumb
