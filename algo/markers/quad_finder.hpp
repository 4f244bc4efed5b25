// SPDX-License-Identifier: Apache-2.0
// Finds candidates for markers: dark convex quadrilaterals on a lighter background.
#pragma once

#include <vector>

#include <opencv2/core/mat.hpp>

#include "algo/types/marker.hpp"

namespace plumb {

/// Parameters of FindDarkQuads(); pixels.
struct QuadFinderOptions {
  double min_side_px = 12.0;  ///< Quadrilaterals with a shorter mean side are left out.
  double border_px =
      1.0;  ///< Quadrilaterals with a corner nearer than this to the border are left out.
  /// Side of the window for the local mean with which a pixel is compared; odd, >= 3.
  int window_px = 23;
  int min_darkness = 7;  ///< Grey levels below the local mean from which a pixel counts as dark.
};

/// Outlines of dark regions within a part of the image that consist of four straight sides, each
/// fitted as a line; corners are accurate to about half a pixel on sharp images. Clockwise as seen
/// (image y down), starting at any corner, in coordinates of the whole image. May contain the same
/// square more than once. Squares that are more than half a window inside the part are found as in
/// the whole image.
/// @param gray  CV_8UC1.
/// @param part  Inside the image, not empty.
/// Thread-safe and deterministic.
[[nodiscard]] std::vector<ImageCorners> FindDarkQuads(const cv::Mat& gray, const cv::Rect& part,
                                                      const QuadFinderOptions& options);

}  // namespace plumb
