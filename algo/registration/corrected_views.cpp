// SPDX-License-Identifier: Apache-2.0
#include "algo/registration/corrected_views.hpp"

#include <algorithm>
#include <memory>
#include <utility>

#include <tbb/parallel_for.h>

#include "algo/base/check_stop.hpp"
#include "algo/geometry/back_projection.hpp"
#include "algo/registration/depth_views.hpp"
#include "algo/sensor_calibration/depth_correction.hpp"

namespace plumb {
namespace {

// std::lround(), which is a call into the library; limited to +-`limit`.
int Rounded(float value, int limit) {
  const auto farthest = static_cast<float>(limit);
  value = std::min(std::max(value, -farthest), farthest);
  const int whole = static_cast<int>(value);
  const float rest = value - static_cast<float>(whole);
  return whole + (rest >= 0.5F ? 1 : 0) - (rest <= -0.5F ? 1 : 0);
}

// Depth after correction by the calibration, as a camera at the stamp would have measured it in one
// instant: each pixel takes its value from where the moving camera's row saw that point.
cv::Mat CorrectedDepth(const cv::Mat& depth_m, const DepthCorrection& correction,
                       const dense::DepthErrors& errors, std::size_t image, double readout_s,
                       const Intrinsics& intrinsics, const RayTable& rays,
                       const Vector6d& velocity_per_s) {
  cv::Mat corrected = cv::Mat::zeros(depth_m.size(), CV_32FC1);
  const Eigen::Vector3f w = velocity_per_s.head<3>().cast<float>();
  const Eigen::Vector3f v = velocity_per_s.tail<3>().cast<float>();
  const bool by_columns = ReadByColumns(intrinsics);
  const bool has_errors = !errors.images.empty();
  const auto fx = static_cast<float>(intrinsics.fx);
  const auto fy = static_cast<float>(intrinsics.fy);
  for (int r = 0; r < depth_m.rows; ++r) {
    const float* here = depth_m.ptr<float>(r);
    float* out = corrected.ptr<float>(r);
    const Eigen::Vector2f* ray = rays.row(r);
    auto late_s = static_cast<float>(readout_s * ((r + 0.5) / depth_m.rows - 0.5));
    for (int c = 0; c < depth_m.cols; ++c) {
      if (here[c] <= 0) continue;
      if (by_columns) late_s = static_cast<float>(readout_s * ((c + 0.5) / depth_m.cols - 0.5));
      const Eigen::Vector3f p(ray[c].x() * here[c], ray[c].y() * here[c], here[c]);
      const Eigen::Vector3f moved = late_s * (w.cross(p) + v);
      // Where this row saw the point that the instantaneous camera sees in this pixel.
      const int x = c - Rounded(fx * (moved.x() - ray[c].x() * moved.z()) / here[c], depth_m.cols);
      const int y = r - Rounded(fy * (moved.y() - ray[c].y() * moved.z()) / here[c], depth_m.rows);
      if (x < 0 || y < 0 || x >= depth_m.cols || y >= depth_m.rows) continue;
      const float z = depth_m.at<float>(y, x);
      if (z <= 0) continue;
      double metric =
          correction.Correct(static_cast<std::size_t>(y * depth_m.cols + x), z) + moved.z();
      if (has_errors)
        metric += errors.Correction(
            image, z, CentredCoordinates(x, y, depth_m.cols, depth_m.rows).cast<float>());
      if (metric > 0) out[c] = static_cast<float>(metric);
    }
  }
  return corrected;
}

}  // namespace

std::vector<ViewSurface> PrepareCorrectedViews(TrackingMap& map, const Intrinsics& stated,
                                               const JointRegistrationResult& joint,
                                               const Pose& T_scene_world,
                                               const ViewSurfaceOptions& options) {
  const CalibrationModel& calibration = joint.calibration;
  const Intrinsics corrected = dense::MakeSensor(stated, calibration).depth;
  const RayTable rays(corrected);
  const auto working_rays = std::make_shared<const RayTable>(WorkingIntrinsics(corrected));
  const DepthCorrection correction(calibration, corrected.width, corrected.height, 1);
  std::vector<std::size_t> with_images;
  for (std::size_t k = 0; k < map.keyframes.size(); ++k) {
    MapKeyframe& keyframe = map.keyframes[k];
    keyframe.dense = {};
    if (keyframe.is_bare) continue;
    with_images.push_back(k);
  }
  std::vector<ViewSurface> surfaces(with_images.size());
  tbb::parallel_for(std::size_t{0}, surfaces.size(), [&](std::size_t k) {
    CheckStop(options.stop);
    MapKeyframe& keyframe = map.keyframes[with_images[k]];
    DepthView view;
    view.intrinsics = corrected;
    view.depth_m =
        CorrectedDepth(keyframe.data.view.depth_m, correction, joint.depth_errors, with_images[k],
                       calibration.depth[kDepthReadout], corrected, rays, keyframe.velocity_per_s);
    view.color_rgb = std::exchange(keyframe.data.view.color_rgb, {});
    view.T_world_camera = T_scene_world * DepthPose(keyframe, calibration);
    keyframe.data.view.depth_m.release();
    surfaces[k] = PrepareView(view, working_rays, options);
    surfaces[k].time_s = keyframe.data.depth_time_s;
  });
  return surfaces;
}

}  // namespace plumb
