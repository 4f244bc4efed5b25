// The two pictures of a result.
#pragma once

#include <string>

#include <opencv2/core/mat.hpp>

#include "algo/comparison/comparison.hpp"

namespace plumb {

struct ResultPictures {
  cv::Mat error_map;  ///< CV_8UC3 RGB, or empty where there is no deviation.
  cv::Mat overlay;    ///< CV_8UC3 RGB, or empty where one of the surfaces is missing.
};

/// Draws the pictures that a comparison allows.
/// @param subtitle  One line under the titles; no patient's name.
[[nodiscard]] ResultPictures DrawResultPictures(const Scene& reference, const Comparison& comparison, const CompareOptions& options,
                                                const std::string& subtitle, bool paper_colors);

}  // namespace plumb
