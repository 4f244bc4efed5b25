// SPDX-License-Identifier: Apache-2.0
// Clouds and meshes as binary little-endian PLY.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "algo/types/point_cloud.hpp"

namespace plumb {

/// float x y z, then, if the cloud has them, float nx ny nz and uchar red green blue.
/// @throws std::invalid_argument if an attribute is neither empty nor as long as the points;
///         IoError.
void WriteCloudPly(const std::filesystem::path& path, const PointCloud& cloud);

/// As WriteCloudPly() for the vertices, then faces as "list uchar int vertex_indices".
/// @throws std::invalid_argument as above, and for a triangle with a missing vertex; IoError.
void WriteMeshPly(const std::filesystem::path& path, const TriangleMesh& mesh);

/// Reads the vertices of a PLY file with any layout of scalar properties; faces are skipped.
/// @throws DataError naming the file if it is missing, truncated, not binary little-endian, or
///         contains numbers that are not finite.
[[nodiscard]] PointCloud ReadCloudPly(const std::filesystem::path& path);
[[nodiscard]] PointCloud ParseCloudPly(std::span<const std::uint8_t> bytes,
                                       const std::string& name);

/// Reads vertices and triangles.
/// @throws DataError as above, and for faces that are not triangles of the vertices.
[[nodiscard]] TriangleMesh ReadMeshPly(const std::filesystem::path& path);
[[nodiscard]] TriangleMesh ParseMeshPly(std::span<const std::uint8_t> bytes,
                                        const std::string& name);

/// One scalar property of the vertices, for example "seen"; empty if they do not have it.
/// @throws DataError as above.
[[nodiscard]] std::vector<float> ParseVertexProperty(std::span<const std::uint8_t> bytes,
                                                     const std::string& name,
                                                     std::string_view property);

}  // namespace plumb
