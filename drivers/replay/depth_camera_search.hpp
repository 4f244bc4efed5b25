// Where the depth camera is, found from the images themselves, for recordings whose depth is not
// registered to colour and that do not say how it would be.
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
  cv::Mat depth_m;    ///< CV_32FC1, same size, metres along the depth camera's axis, 0 = nothing.
};

/// A depth camera, and how well the images bear it out.
struct FoundDepthCamera {
  DepthCamera camera;  ///< Without a lens of its own, its axes parallel to the colour camera's.
  double gain = 0.0;   ///< How many times better edges agree with it than with registered depth,
                       ///< on pairs that the search did not use.
};

/// Steps in depth mostly lie on edges of the colour image. The search takes the focal length,
/// the principal point and the sideways distance of the depth camera under which they do: zoom
/// 0.86 to 1.04 of the colour image, 24 px (of 640) each way, 0.05 px m of parallax and less
/// (25 mm in sensors of the Kinect's class). A sensor of that class has its infrared camera 25 mm
/// beside the colour camera and magnifies by a tenth more, so that unregistered depth lies up to
/// 40 px off.
///
/// Every second pair is searched, the others judge: nothing is found unless edges agree there at
/// least twice as well as with depth taken as registered, shifted by up to 6 px. Deterministic.
///
/// @param pairs  Spread over the recording; 8 to 24 are enough.
/// @return nothing if the pairs show too few steps in depth or do not clearly contradict
///         registered depth.
/// @throws std::invalid_argument if an image has another type or size than `color` says.
[[nodiscard]] std::optional<FoundDepthCamera> FindDepthCamera(std::span<const ImagePair> pairs,
                                                              const Intrinsics& color);

}  // namespace plumb
