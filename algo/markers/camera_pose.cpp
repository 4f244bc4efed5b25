// SPDX-License-Identifier: Apache-2.0
#include "algo/markers/camera_pose.hpp"

#include <opencv2/calib3d.hpp>

namespace plumb {

Pose PoseFromCv(const cv::Mat& rotation_vector, const cv::Mat& translation) {
  Vector6d twist;
  for (int i = 0; i < 3; ++i) {
    twist[i] = rotation_vector.at<double>(i);
    twist[3 + i] = translation.at<double>(i);
  }
  return PoseFromTwist(twist);
}

std::optional<Pose> PoseFromPoints(const std::vector<cv::Point3d>& points_m,
                                   const std::vector<cv::Point2d>& ideal) {
  cv::Mat rotation, translation;
  if (!cv::solvePnP(points_m, ideal, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), rotation,
                    translation, false, cv::SOLVEPNP_SQPNP))
    return std::nullopt;
  return PoseFromCv(rotation, translation);
}

}  // namespace plumb
