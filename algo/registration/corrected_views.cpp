// SPDX-License-Identifier: Apache-2.0
#include "algo/registration/corrected_views.hpp"

#include <algorithm>
#include <memory>

#include <tbb/parallel_for.h>

#include "algo/base/check_stop.hpp"
#include "algo/geometry/back_projection.hpp"
#include "algo/geometry/working_image.hpp"
#include "algo/registration/depth_views.hpp"
#include "algo/sensor_calibration/depth_correction.hpp"

namespace plumb {
namespace {

// Depth between the pixels of a working image: of the four around the place where no edge separates
// them, otherwise of the nearest; 0 where nothing was measured, and outside.
float DepthBetween(const cv::Mat& depth_m, float x, float y, const DepthNoise& noise,
                   float pixel_rad) {
  const auto last_x = static_cast<float>(depth_m.cols - 1);
  const auto last_y = static_cast<float>(depth_m.rows - 1);
  if (!(x >= -0.5F && y >= -0.5F && x <= last_x + 0.5F && y <= last_y + 0.5F)) return 0.0F;
  x = std::clamp(x, 0.0F, last_x);
  y = std::clamp(y, 0.0F, last_y);
  const int column = std::min(static_cast<int>(x), std::max(0, depth_m.cols - 2));
  const int row = std::min(static_cast<int>(y), std::max(0, depth_m.rows - 2));
  const float right = x - static_cast<float>(column);
  const float down = y - static_cast<float>(row);
  const float* top = depth_m.ptr<float>(row) + column;
  const float* bottom = depth_m.ptr<float>(std::min(row + 1, depth_m.rows - 1)) + column;
  const int next = depth_m.cols > 1 ? 1 : 0;
  const float nearest = std::min(std::min(top[0], top[next]), std::min(bottom[0], bottom[next]));
  const float farthest = std::max(std::max(top[0], top[next]), std::max(bottom[0], bottom[next]));
  if (!(nearest > 0.0F && farthest - nearest <= EdgeStep_m(noise, nearest, pixel_rad)))
    return (down < 0.5F ? top : bottom)[right < 0.5F ? 0 : next];
  const float above = top[0] + right * (top[next] - top[0]);
  const float below = bottom[0] + right * (bottom[next] - bottom[0]);
  return above + down * (below - above);
}

// The working images of one sweep, as they are converted.
class Converter {
 public:
  Converter(const Intrinsics& stated, const JointRegistrationResult& joint, const DepthNoise& noise)
      : stated_(stated),
        joint_(joint),
        noise_(noise),
        working_(WorkingIntrinsics(dense::MakeSensor(stated, joint.calibration).depth)),
        rays_(std::make_shared<const RayTable>(working_)),
        correction_(joint.calibration, stated.width, stated.height, block_) {}

  [[nodiscard]] const Intrinsics& working() const { return working_; }
  [[nodiscard]] const std::shared_ptr<const RayTable>& rays() const { return rays_; }

  // Depth after correction by the calibration, as a camera at the stamp would have measured it in
  // one instant: each pixel takes its value from where the moving camera's line saw that point.
  // @param image  The keyframe's number among the errors of single images.
  [[nodiscard]] cv::Mat Convert(const cv::Mat& depth_m, const Vector6d& velocity_per_s,
                                std::size_t image) const {
    cv::Mat converted = cv::Mat::zeros(depth_m.size(), CV_32FC1);
    const Eigen::Vector3f w = velocity_per_s.head<3>().cast<float>();
    const Eigen::Vector3f v = velocity_per_s.tail<3>().cast<float>();
    const bool by_columns = ReadByColumns(stated_);
    const auto fx = static_cast<float>(working_.fx);
    const auto fy = static_cast<float>(working_.fy);
    for (int r = 0; r < depth_m.rows; ++r) {
      const float* here = depth_m.ptr<float>(r);
      auto* const out = converted.ptr<float>(r);
      const Eigen::Vector2f* ray = rays_->row(r);
      float late_s = Late_s(r, stated_.height);
      for (int c = 0; c < depth_m.cols; ++c) {
        if (here[c] <= 0) continue;
        if (by_columns) late_s = Late_s(c, stated_.width);
        const Eigen::Vector3f p(ray[c].x() * here[c], ray[c].y() * here[c], here[c]);
        const Eigen::Vector3f moved = late_s * (w.cross(p) + v);
        // Where this line saw the point that the instantaneous camera sees in this pixel.
        const float x = static_cast<float>(c) - fx * (moved.x() - ray[c].x() * moved.z()) / here[c];
        const float y = static_cast<float>(r) - fy * (moved.y() - ray[c].y() * moved.z()) / here[c];
        const float z = DepthBetween(depth_m, x, y, noise_, 1.0F / fx);
        if (z > 0) out[c] = std::max(0.0F, Corrected(depth_m, x, y, z, image) + moved.z());
      }
    }
    return converted;
  }

 private:
  // Of a line of working pixels, after the image's stamp.
  // @param num_lines  Of the stated image; whole blocks need not cover it.
  [[nodiscard]] float Late_s(int line, int num_lines) const {
    return static_cast<float>(joint_.calibration.depth[kDepthReadout] *
                              ((line + 0.5) * block_ / num_lines - 0.5));
  }

  // A depth that was measured at a place of the working image. Its correction changes slowly over
  // the image.
  [[nodiscard]] float Corrected(const cv::Mat& depth_m, float x, float y, float z,
                                std::size_t image) const {
    const int column = std::clamp(static_cast<int>(x + 0.5F), 0, depth_m.cols - 1);
    const int row = std::clamp(static_cast<int>(y + 0.5F), 0, depth_m.rows - 1);
    double metric_m = correction_.Correct(static_cast<std::size_t>(row * depth_m.cols + column), z);
    if (!joint_.depth_errors.images.empty())
      metric_m += joint_.depth_errors.Correction(
          image, z,
          CentredCoordinates((column + 0.5) * block_ - 0.5, (row + 0.5) * block_ - 0.5,
                             stated_.width, stated_.height)
              .cast<float>());
    return static_cast<float>(metric_m);
  }

  const Intrinsics& stated_;
  const JointRegistrationResult& joint_;
  const DepthNoise& noise_;
  int block_ = WorkingBlock(stated_);
  Intrinsics working_;
  std::shared_ptr<const RayTable> rays_;
  DepthCorrection correction_;
};

}  // namespace

std::vector<ViewSurface> PrepareCorrectedViews(TrackingMap& map, const Intrinsics& stated,
                                               const JointRegistrationResult& joint,
                                               const Pose& T_scene_world,
                                               const ViewSurfaceOptions& options) {
  const Converter converter(stated, joint, options.depth_noise);
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
    view.intrinsics = converter.working();
    view.depth_m =
        converter.Convert(WorkingDepth(keyframe.data.view.depth_m, stated, options.depth_noise),
                          keyframe.velocity_per_s, with_images[k]);
    if (!keyframe.data.view.color_rgb.empty())
      view.color_rgb = WorkingColor(keyframe.data.view.color_rgb, stated);
    keyframe.data.view.color_rgb.release();
    view.T_world_camera = T_scene_world * DepthPose(keyframe, joint.calibration);
    keyframe.data.view.depth_m.release();
    surfaces[k] = PrepareView(view, converter.rays(), options);
    surfaces[k].time_s = keyframe.data.depth_time_s;
  });
  return surfaces;
}

}  // namespace plumb
