// Candidates for markers: dark convex quadrilaterals on a lighter ground.
#pragma once

#include <vector>

#include <opencv2/core/mat.hpp>

#include "algo/types/marker.hpp"

namespace plumb {

/// Parameters of FindDarkQuads(); pixels.
struct QuadFinderOptions {
  double min_side_px = 12.0;  ///< Shorter mean sides are left out.
  double border_px =
      1.0;               ///< Quadrilaterals with a corner nearer to the image border are left out.
  int window_px = 23;    ///< Side of the local mean that a pixel is compared with; odd, >= 3.
  int min_darkness = 7;  ///< A pixel is dark if it is so much below the local mean (grey levels).
};

/// Outlines of dark regions that are four straight sides, each fitted as a line: corners are right
/// to about half a pixel on sharp images. Clockwise as seen (image y down), the first corner
/// arbitrary. May hold the same square more than once.
/// @param gray  CV_8UC1.
/// Thread-safe and deterministic.
[[nodiscard]] std::vector<ImageCorners> FindDarkQuads(const cv::Mat& gray,
                                                      const QuadFinderOptions& options);
/// The same within a part of the image: what lies deeper in it than half a window is found as in
/// the whole. Corners are those of the whole image.
/// @param part  Inside the image, not empty.
[[nodiscard]] std::vector<ImageCorners> FindDarkQuads(const cv::Mat& gray, const cv::Rect& part,
                                                      const QuadFinderOptions& options);

}  // namespace plumb
