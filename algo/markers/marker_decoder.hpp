// SPDX-License-Identifier: Apache-2.0
// Reads the code of a square in an image.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "algo/types/marker.hpp"
#include "algo/types/marker_dictionary.hpp"

namespace plumb {

/// A square whose cells match a code of the dictionary.
struct DecodedMarker {
  int id = 0;
  ImageCorners corners;  ///< As given, rotated so that the first is the top-left one on the print.
  int wrong_bits = 0;    ///< Code cells that differ from the dictionary's.
};

/// Matches squares against one dictionary. Immutable; safe to share between threads.
class MarkerDecoder {
 public:
  /// @param max_wrong_bits  Code cells that may differ; above half the dictionary's distance, codes
  ///         are confused.
  MarkerDecoder(const MarkerDictionary& dictionary, int max_wrong_bits);

  /// @param gray     CV_8UC1.
  /// @param corners  Of the black square, clockwise as seen, starting at any of them.
  /// @return nothing if the square has no black border, too little contrast or no code of the
  ///         dictionary.
  [[nodiscard]] std::optional<DecodedMarker> Decode(const cv::Mat& gray,
                                                    const ImageCorners& corners) const;

 private:
  struct Rotated {
    std::uint64_t code;
    int id;
    int turns;  ///< Quarter turns of the print, clockwise as seen.
  };
  int bits_per_side_;
  int max_wrong_bits_;
  std::vector<Rotated> codes_;
};

}  // namespace plumb
