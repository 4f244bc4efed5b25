// SPDX-License-Identifier: Apache-2.0
// What a second structured-light sensor does to the depth image of a first one that stands still.
#pragma once

#include <cstdint>
#include <vector>

#include <opencv2/core/mat.hpp>

namespace plumb::simulated {

/// Where two patterns overlap, windows of pixels are matched to the wrong one or to none. Both
/// sensors stand still, so the places stay; the images of the two are not taken at the same
/// moments, so the errors come and go. Immutable; a pure function of its arguments.
class OtherProjector {
 public:
  OtherProjector(std::uint64_t seed, int width, int height);

  /// @param depth_m  CV_32FC1 of the size given, metres, 0 where nothing was measured.
  void Disturb(double time_s, cv::Mat& depth_m) const;

 private:
  std::vector<float> lost_, wrong_;  ///< Of unit variance, by pixel.
};

}  // namespace plumb::simulated
