// Maps of a scan as few bytes, for a browser over a slow network.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "algo/types/height_map.hpp"

namespace plumb {

/// "heightmap", "deviation" or "deviation_after": heights in tenths of a millimetre; "region": 1
/// where a cell of the region of interest was measured by both scans, 2 where it was not (a hole);
/// "body": 1 in the region that a comparison with this scan takes where no plan draws one.
/// Cells are on the grid of the scene (heightmap) or of the reference's scene (the others).
///
/// The bytes: "PLM1", then six little-endian 16-bit numbers: width and height of the grid, column
/// and row at which the part begins that holds values, its width and height; then a zlib stream of
/// that part's cells, row by row, as little-endian 16-bit differences from the cell before (the
/// first of a row: from 0, modulo 2^16). -32768 is a cell without a value.
///
/// Takes some 100 ms: not for the loop. @param scan_folder  Holds scene/ and result/.
/// @throws DataError if there is no such map or it cannot be read.
[[nodiscard]] std::string CompactMap(const std::filesystem::path& scan_folder,
                                     std::string_view name);

/// The same bytes of a map in memory, of at most some 10,000 cells: about a millisecond.
/// @param missing  As many as there are cells, or none: 1 writes 32767, whatever the height.
[[nodiscard]] std::string CompactHeights(const HeightMap& heights,
                                         const std::vector<std::uint8_t>& missing);

}  // namespace plumb
