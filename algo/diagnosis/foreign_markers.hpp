// SPDX-License-Identifier: Apache-2.0
// Why a sweep that shows squares decodes no marker.
#pragma once

#include <optional>
#include <span>
#include <string>

#include <opencv2/core/mat.hpp>

#include "algo/types/marker_dictionary.hpp"

namespace plumb {

struct ForeignMarkers {
  enum class Kind { kMirrored, kInverted, kOtherDictionary };
  Kind kind = Kind::kMirrored;
  std::string dictionary;  ///< The one that fits.
};

/// Tries the images mirrored, inverted, and with every other dictionary.
/// @param images  CV_8UC1, or CV_8UC3 (red, green, blue).
/// @return what explains most squares; nothing if no explanation finds the same marker twice.
[[nodiscard]] std::optional<ForeignMarkers> FindForeignMarkers(std::span<const cv::Mat> images,
                                                               const MarkerDictionary& dictionary);

}  // namespace plumb
