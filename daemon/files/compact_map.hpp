// SPDX-License-Identifier: Apache-2.0
// Compact encodings of a scan's maps and surface, for a browser on a slow network.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "algo/types/height_map.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb {

/// Maps: "heightmap", "deviation" or "deviation_after" with heights in tenths of a millimetre;
/// "region" with 1 where a cell of the region of interest was measured by both scans and 2 where it
/// was not (a hole); "body" with 1 in the region that a comparison with this scan uses if no plan
/// draws one. Cells are on the grid of the scene (heightmap) or of the reference's scene (the
/// others).
///
/// Format: "PLM1", then six little-endian 16-bit numbers: width and height of the grid, column and
/// row of the part that contains values, its width and height; then a zlib stream of that part's
/// cells, row by row, as little-endian 16-bit differences from the previous cell (for the first of
/// a row from 0, modulo 2^16). -32768 is a cell without a value.
///
/// "mesh" is the surface of the scene, as CompactMesh() packs it.
///
/// Takes about 100 ms, a surface up to a second: not for the loop.
/// @param scan_folder  Contains scene/ and result/.
/// @throws DataError if there is no such map or it cannot be read.
[[nodiscard]] std::string CompactMap(const std::filesystem::path& scan_folder,
                                     std::string_view name);

/// The same encoding of a map in memory, of at most some 10,000 cells, in about a millisecond.
/// @param missing  One value per cell, or empty: 1 writes 32767 instead of the height.
[[nodiscard]] std::string CompactHeights(const HeightMap& heights,
                                         const std::vector<std::uint8_t>& missing);

/// Vertices and triangles, without normals and colours, in a fraction of the size of the PLY file.
///
/// Format, all little-endian: "PLM2"; the numbers of vertices and triangles, 32 bits each; the
/// least x, y and z and the size of a step, 32-bit floats in metres; then a zlib stream. It
/// contains the x of all vertices, then the y, then the z, in steps above the least, as 16-bit
/// differences from the previous vertex (for the first from 0, modulo 2^16); then the corners of
/// the triangles as differences from the previous corner (for the first from 0), each as a zigzag
/// number (0, -1, 1, -2 are 0, 1, 2, 3) in groups of 7 bits, the lowest first, with bit 7 set in
/// all but the last.
///
/// The largest extent is 65535 steps: a body of 2 m has steps of 0.03 mm. Takes up to a second.
/// @throws std::invalid_argument for a triangle with a missing vertex; DataError for more than 2^25
///         vertices or triangles, which a browser refuses.
[[nodiscard]] std::string CompactMesh(const TriangleMesh& mesh);

}  // namespace plumb
