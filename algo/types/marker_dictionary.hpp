// SPDX-License-Identifier: Apache-2.0
// The supported families of square fiducial markers: names, code words, patterns.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace plumb {

/// One family of markers: a square of bits_per_side() x bits_per_side() cells inside a black border
/// of one cell. Immutable and cheap to move; safe to share between threads.
class MarkerDictionary {
 public:
  /// The dictionary of that name, or nothing if it is unknown. Names are OpenCV's (DICT_4X4_50 ..
  /// DICT_APRILTAG_36h11) and DICT_ARUCO_MIP_36h12, which OpenCV 4.6 does not have. Letter case
  /// does not matter; name() has the usual spelling.
  [[nodiscard]] static std::optional<MarkerDictionary> Find(std::string_view name);

  /// As Find(). @throws DataError for an unknown name; the message lists the known ones.
  [[nodiscard]] static MarkerDictionary ByName(std::string_view name);

  /// Names that Find() accepts, in OpenCV's order, then Plumb's own.
  [[nodiscard]] static const std::vector<std::string>& KnownNames();

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] int size() const {
    return static_cast<int>(codes_.size());
  }  ///< Ids are 0 .. size() - 1.
  [[nodiscard]] int bits_per_side() const {
    return bits_per_side_;
  }  ///< Cells of the code, without the border.
  [[nodiscard]] int max_correction_bits() const {
    return max_correction_bits_;
  }  ///< Wrong bits that stay unambiguous.

  /// True if the cell is white. Row 0 is the top and column 0 the left one on the upright print, so
  /// that the first corner of the marker (detector order) is the outer corner of cell (0, 0).
  /// @throws std::invalid_argument outside the dictionary or the pattern.
  [[nodiscard]] bool Bit(int id, int row, int column) const;

  /// All cells of a marker, row-major from the top left, the first cell in the highest of the
  /// bits_per_side()^2 bits.
  /// @throws std::invalid_argument outside the dictionary.
  [[nodiscard]] std::uint64_t Code(int id) const;

 private:
  MarkerDictionary(std::string name, int bits_per_side, int max_correction_bits,
                   std::vector<std::uint64_t> codes);

  std::string name_;
  int bits_per_side_ = 0;
  int max_correction_bits_ = 0;
  std::vector<std::uint64_t> codes_;
};

}  // namespace plumb
