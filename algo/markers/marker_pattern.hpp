// SPDX-License-Identifier: Apache-2.0
// What a marker looks like, and the curve by which an image encodes light.
#pragma once

#include <array>
#include <cstdint>

namespace plumb {

/// The cells of one marker, upright: code cells row-major from the top left, highest bit first, 1 =
/// white.
struct MarkerPattern {
  std::uint64_t code = 0;
  int bits_per_side = 6;  ///< 1 to 8; surrounded by a border of one black cell.

  [[nodiscard]] bool White(int row, int column) const {
    return ((code >> (bits_per_side * bits_per_side - 1 - (row * bits_per_side + column))) & 1U) !=
           0;
  }
};

/// Light (0 to 1) for each value of an 8-bit image.
using ToneTable = std::array<float, 256>;

}  // namespace plumb
