// SPDX-License-Identifier: Apache-2.0
// Finds square fiducial markers in an image, with sub-pixel corners.
#pragma once

#include <vector>

#include <opencv2/core/mat.hpp>

#include "algo/markers/marker_decoder.hpp"
#include "algo/types/marker.hpp"
#include "algo/types/marker_dictionary.hpp"

namespace plumb {

/// Parameters of MarkerDetector. Lengths are in pixels of the searched image.
struct MarkerDetectorOptions {
  double min_side_px = 14.0;  ///< Markers with a shorter mean side are not reported; >= 8.
  double border_px =
      1.0;  ///< A marker with a corner nearer than this to the border is left out; >= 0.
};

/// Detections in one image.
struct MarkerDetection {
  std::vector<MarkerObservation> markers;  ///< Ascending by id, each id once.
  std::vector<int> duplicate_ids;  ///< Ids seen more than once in this image, ascending: none of
                                   ///< them is reported.
};

/// Detects the markers of one dictionary. Stateless between images: Detect() may run in several
/// threads at once and gives the same bits for the same image.
class MarkerDetector {
 public:
  /// @throws std::invalid_argument if an option is out of range.
  explicit MarkerDetector(const MarkerDictionary& dictionary,
                          const MarkerDetectorOptions& options = {});

  /// Markers in an image, CV_8UC1 or CV_8UC3 (red, green, blue). Corners are in pixels, centres at
  /// integers, in detector order, as seen (distorted). Markers that are partly covered or cut by
  /// the border are not reported.
  /// @throws std::invalid_argument for an empty image or another type.
  [[nodiscard]] MarkerDetection Detect(const cv::Mat& gray_or_rgb) const;

  /// Only the markers around expected places, bit for bit as Detect() finds them there but faster.
  /// Another marker with the same id elsewhere is not noticed.
  /// @param gray      CV_8UC1.
  /// @param expected  Corners; markers within 3 % of the image's width are found.
  [[nodiscard]] MarkerDetection DetectNear(const cv::Mat& gray,
                                           const std::vector<ImageCorners>& expected) const;

 private:
  [[nodiscard]] MarkerObservation Refined(const cv::Mat& gray, const DecodedMarker& marker) const;
  [[nodiscard]] MarkerDetection DetectIn(const cv::Mat& gray,
                                         const std::vector<cv::Rect>& parts) const;

  MarkerDetectorOptions options_;
  MarkerDictionary dictionary_;
  MarkerDecoder decoder_;
};

}  // namespace plumb
