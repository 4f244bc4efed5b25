// Finds square fiducial markers in an image, with sub-pixel corners.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"
#include "algo/types/marker.hpp"
#include "algo/types/marker_dictionary.hpp"

namespace plumb {

/// Parameters of MarkerDetector. Lengths in pixels of the image that is searched.
struct MarkerDetectorOptions {
  double min_side_px = 14.0;  ///< Markers with a shorter mean side are not reported; >= 8.
  double border_px =
      1.0;  ///< A marker with a corner nearer than this to the image border is not reported; >= 0.
  bool refine_corners = true;  ///< False: the corners as detected, to about half a pixel.
  bool linear_light =
      true;  ///< Undo the sRGB tone curve for the refinement; see CornerRefinementOptions.
  std::optional<Intrinsics> intrinsics = std::nullopt;  ///< If given, the refinement allows for the
                                                        ///< bow that the lens puts on the sides.
};

/// What one image showed.
struct MarkerDetection {
  std::vector<MarkerObservation> markers;  ///< Ascending by id, each id once.
  std::vector<int> duplicate_ids;  ///< Ids seen more than once in this image, ascending: none of
                                   ///< them is reported.
};

/// Detects the markers of one dictionary. Stateless between images: Detect() may run on several
/// threads at once and gives the same bits for the same image.
class MarkerDetector {
 public:
  /// @throws std::invalid_argument if an option is out of range.
  explicit MarkerDetector(const MarkerDictionary& dictionary,
                          const MarkerDetectorOptions& options = {});
  ~MarkerDetector();
  MarkerDetector(MarkerDetector&&) noexcept;
  MarkerDetector& operator=(MarkerDetector&&) noexcept;

  /// Markers in an image, CV_8UC1 or CV_8UC3 (red, green, blue). Corners are in pixels, centres at
  /// integers, in detector order, as seen (distorted); markers that are partly covered or cut by
  /// the border are not reported.
  /// @throws std::invalid_argument for an empty image or another type.
  [[nodiscard]] MarkerDetection Detect(const cv::Mat& gray_or_rgb) const;

  /// Only what lies around expected places, bit for bit as Detect() finds it there, for less time.
  /// An id that is seen once more elsewhere is not noticed.
  /// @param gray      CV_8UC1.
  /// @param expected  Corners; markers up to 3 % of the image's width away are found.
  [[nodiscard]] MarkerDetection DetectNear(const cv::Mat& gray,
                                           const std::vector<ImageCorners>& expected) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
