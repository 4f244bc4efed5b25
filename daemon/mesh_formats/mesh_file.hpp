// SPDX-License-Identifier: Apache-2.0
// Meshes for other programs: PLY, STL, OBJ.
#pragma once

#include <filesystem>

#include "algo/base/names.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb {

/// Unit of the coordinates in a file.
enum class MeshUnit { kMetres, kMillimetres };
template <>
inline constexpr auto kNamesOf<MeshUnit> = NamesUpTo<MeshUnit::kMillimetres>({"m", "mm"});

/// What programs expect that read the format: millimetres in STL, which has no place to state a
/// unit, metres in the others.
/// @throws InvalidRequest for another extension than .ply, .stl and .obj (either case).
[[nodiscard]] MeshUnit UsualUnit(const std::filesystem::path& path);

/// Binary STL: triangles with the normals of their planes; this format has no colours.
/// @throws std::invalid_argument for a triangle with a missing vertex; IoError.
void WriteMeshStl(const std::filesystem::path& path, const TriangleMesh& mesh, MeshUnit unit);

/// OBJ: vertices (with colours after the coordinates if there are any), vertex normals,
/// faces.
/// @throws as WriteMeshStl().
void WriteMeshObj(const std::filesystem::path& path, const TriangleMesh& mesh, MeshUnit unit);

/// Writes the format of the name's extension: .ply, .stl or .obj (either case), completely or not
/// at all.
/// @throws InvalidRequest for another extension; IoError.
void WriteMeshFile(const std::filesystem::path& path, const TriangleMesh& mesh, MeshUnit unit);

}  // namespace plumb
