// SPDX-License-Identifier: Apache-2.0
// Where a camera is, by points that it sees.
#pragma once

#include <optional>
#include <vector>

#include <opencv2/core/types.hpp>

#include "algo/base/pose.hpp"

namespace plumb {

/// OpenCV's rotation vector and translation, both of three doubles, as a pose.
[[nodiscard]] Pose PoseFromCv(const cv::Mat& rotation_vector, const cv::Mat& translation);

/// T_camera_points by SQPnP, for at least four points; nothing where that finds none.
/// @param points_m  In any frame.
/// @param ideal     Where they are seen, on the plane z = 1 without distortion (Undistort()).
[[nodiscard]] std::optional<Pose> PoseFromPoints(const std::vector<cv::Point3d>& points_m,
                                                 const std::vector<cv::Point2d>& ideal);

}  // namespace plumb
