// SPDX-License-Identifier: Apache-2.0
// Estimates the depth camera from the images, for recordings whose depth is not registered to
// colour and that do not state the depth camera.
#pragma once

#include <optional>
#include <span>

#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"
#include "drivers/replay/camera_file.hpp"

namespace plumb {

/// Colour and depth image of one moment.
struct ImagePair {
  cv::Mat color_rgb;  ///< CV_8UC3.
  /// CV_32FC1, same size, metres along the depth camera's axis, 0 where nothing was measured.
  cv::Mat depth_m;
};

/// A depth camera and how well the images support it.
struct FoundDepthCamera {
  DepthCamera camera;  ///< Without lens distortion, with axes parallel to the colour camera's.
  /// Factor by which edges agree better with it than with registered depth, on pairs that the
  /// search did not use.
  double gain = 0.0;
};

/// Depth steps mostly lie on edges of the colour image. The search finds the focal length, the
/// principal point and the lateral offset of the depth camera for which they do: zoom 0.86 to 1.04
/// of the colour image, 24 px (of 640) in each direction, 0.05 px m of parallax and less (25 mm in
/// sensors of the Kinect class). Such a sensor has its infrared camera 25 mm beside the colour
/// camera and a magnification larger by a tenth, so that unregistered depth is displaced by up to
/// 40 px.
///
/// Every second pair is used for the search, the others for the check: a camera is returned only if
/// edges agree there at least twice as well as with registered depth that is shifted by up to 6 px,
/// if its zoom is not at the edge of what was searched, and if no other camera agrees nearly as
/// well. A camera that sees much more than the colour camera (a RealSense D435's, zoom 1.57) is not
/// found: of simulated ones with noise the zoom came out 1 % off. Deterministic.
///
/// @param pairs  Spread over the recording; 8 to 24 are enough.
/// @return nothing if the pairs show too few depth steps or do not clearly contradict registered
///         depth, or if the best camera has a zoom at the edge of the search or is not clearly the
///         best.
/// @throws std::invalid_argument if an image has another type or size than `color` states.
[[nodiscard]] std::optional<FoundDepthCamera> FindDepthCamera(std::span<const ImagePair> pairs,
                                                              const Intrinsics& color);

}  // namespace plumb
