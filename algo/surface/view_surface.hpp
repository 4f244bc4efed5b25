// SPDX-License-Identifier: Apache-2.0
// Prepares one depth image for surface reconstruction: normals, noise weights, and removal of
// unreliable pixels.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <stop_token>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "algo/geometry/back_projection.hpp"
#include "algo/geometry/packed_normal.hpp"
#include "algo/sensor_model/depth_noise.hpp"
#include "algo/types/keyframe.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb {

/// Standard deviation of one depth measurement, metres.
/// @param depth_m  Along the optical axis.
/// @param cos_incidence  Between surface normal and viewing ray, in (0, 1].
[[nodiscard]] float AxialSigma(const DepthNoise& noise, float depth_m, float cos_incidence);

struct ViewSurfaceOptions {
  float min_depth_m = 0.3F;
  float max_depth_m = 4.0F;
  float max_incidence_deg = 75.0F;  ///< Steeper views of a surface are left out; in (0, 89].
  DepthNoise depth_noise = {};      ///< The sensor's, see StreamInfo.
  /// Pixels (at 640 columns) on both sides of a depth edge that are left out in addition to the rim
  /// that every sensor has; see DepthSensorClass.
  int edge_px = 0;
  std::stop_token stop = {};  ///< Polled by PrepareViews(); see CheckStop().
};

/// A depth image at working resolution, see WorkingDepth(). All vectors have width * height values,
/// row by row.
struct ViewSurface {
  /// Inverse depth and weight are stored together because searches need both.
  struct Pixel {
    float inverse_depth = 0.0F;  ///< 1/m; 0 where nothing was measured.
    /// 1 / variance (1/m^2) times the cosine of incidence; 0 if the pixel must not be used (depth
    /// edge, rim, grazing view, out of range).
    float weight = 0.0F;
  };

  Intrinsics intrinsics;   ///< Camera of the working image.
  DepthNoise depth_noise;  ///< Of the depth image's pixels, not of their means.
  cv::Mat color_rgb;       ///< CV_8UC3, or empty.
  double time_s = 0.0;     ///< When the depth image was taken.
  Pose T_world_camera = Pose::Identity();
  std::shared_ptr<const RayTable>
      rays;  ///< Of the working pixels; shared by the views of one camera.
  std::vector<Pixel> pixels;
  /// Camera frame, towards the camera; valid where weight > 0. Packed, because the views of a sweep
  /// are most of what its solution keeps in memory.
  std::vector<PackedNormal> normals;

  [[nodiscard]] int width() const { return intrinsics.width; }
  [[nodiscard]] int height() const { return intrinsics.height; }
  [[nodiscard]] std::size_t size() const { return pixels.size(); }
  /// Point of a measured working pixel in the camera frame, metres.
  [[nodiscard]] Eigen::Vector3f PointInCamera(std::size_t i) const {
    const float z = 1.0F / pixels[i].inverse_depth;
    const Eigen::Vector2f& ray = rays->row(0)[i];
    return {ray.x() * z, ray.y() * z, z};
  }
  /// Colour at a working pixel; black without a colour image.
  [[nodiscard]] Color ColorAt(std::size_t i) const;
};

/// Prepares one view. Its images may also be at working resolution: depth with the camera of that
/// resolution, colour with either.
/// @param working_rays  RayTable of WorkingIntrinsics(view.intrinsics).
/// @throws std::invalid_argument if images, intrinsics, rays or options do not fit together.
[[nodiscard]] ViewSurface PrepareView(const DepthView& view,
                                      const std::shared_ptr<const RayTable>& working_rays,
                                      const ViewSurfaceOptions& options = {});

/// Prepares all views in parallel. Deterministic.
/// @throws std::invalid_argument naming the view that does not fit.
[[nodiscard]] std::vector<ViewSurface> PrepareViews(std::span<const DepthView> views,
                                                    const ViewSurfaceOptions& options = {});

}  // namespace plumb
