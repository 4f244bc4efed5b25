// SPDX-License-Identifier: Apache-2.0
// A frame kept for reconstruction.
#pragma once

#include <cstdint>
#include <vector>

#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"
#include "algo/base/pose.hpp"
#include "algo/types/marker.hpp"

namespace plumb {

/// A depth image with its pose, the input of surfaces. The images are shared by reference count. In
/// a tracker's map they may be at working resolution, see TrackerOptions::keep_working_images.
struct DepthView {
  Intrinsics intrinsics;  ///< Of the depth image (colour camera's grid when registered).
  cv::Mat depth_m;        ///< CV_32FC1, metres, 0 where nothing was measured.
  cv::Mat color_rgb;      ///< CV_8UC3 of the same size, or empty.
  Pose T_world_camera = Pose::Identity();  ///< At the depth image's time.
};

/// A frame kept for reconstruction, with its view, its stamps and the markers in its colour image.
struct Keyframe {
  std::int64_t frame_index = 0;
  double color_time_s = 0.0;
  double depth_time_s = 0.0;
  DepthView view;
  std::vector<MarkerObservation> markers;
};

}  // namespace plumb
