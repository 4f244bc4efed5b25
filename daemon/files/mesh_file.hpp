// Meshes for other programs: PLY, STL, OBJ.
#pragma once

#include <filesystem>

#include "algo/types/point_cloud.hpp"

namespace plumb {

/// Binary STL in metres: triangles with the normals of their planes; this format has no colours.
/// @throws std::invalid_argument for a triangle with a missing vertex; IoError.
void WriteMeshStl(const std::filesystem::path& path, const TriangleMesh& mesh);

/// OBJ in metres: vertices (with colours after the coordinates if there are any), vertex normals,
/// faces.
/// @throws as WriteMeshStl().
void WriteMeshObj(const std::filesystem::path& path, const TriangleMesh& mesh);

/// Writes the format of the name's extension: .ply, .stl or .obj (either case), completely or not
/// at all.
/// @throws std::invalid_argument for another extension; IoError.
void WriteMeshFile(const std::filesystem::path& path, const TriangleMesh& mesh);

}  // namespace plumb
