// SPDX-License-Identifier: Apache-2.0
#include "algo/registration/corrected_views.hpp"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "algo/base/statistics.hpp"
#include "algo/geometry/working_image.hpp"
#include "tests/support/analytic_scene.hpp"

namespace plumb {
namespace {

using testing::DomeScene;

// A floor, and a box whose side away from the camera nobody sees: at x = 0 the height falls from
// kBox_m to 0.
struct StepScene {
  static constexpr double kBox_m = 0.04;
  [[nodiscard]] double Cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
    const double on_box = (kBox_m - origin.z()) / direction.z();
    return origin.x() + on_box * direction.x() < 0 ? on_box : -origin.z() / direction.z();
  }
};

// A scene as a camera in motion sees it that reads its lines one after the other. Its depth is
// `factor` times the true one.
template <typename SceneType>
MapKeyframe MovingView(const SceneType& scene, const Pose& T_world_color, const Intrinsics& camera,
                       const Vector6d& velocity_per_s, double readout_s, double factor) {
  const RayTable rays(camera);
  MapKeyframe keyframe;
  keyframe.T_world_color = T_world_color;
  keyframe.velocity_per_s = velocity_per_s;
  cv::Mat& depth_m = keyframe.data.view.depth_m;
  depth_m = cv::Mat::zeros(camera.height, camera.width, CV_32FC1);
  for (int row = 0; row < camera.height; ++row)
    for (int column = 0; column < camera.width; ++column) {
      const double line =
          ReadByColumns(camera) ? (column + 0.5) / camera.width : (row + 0.5) / camera.height;
      const Pose T_world_line =
          PoseAfter(keyframe.T_world_color, velocity_per_s, readout_s * (line - 0.5));
      const Eigen::Vector3d ray = rays.ideal(row, column).cast<double>().homogeneous();
      depth_m.at<float>(row, column) = static_cast<float>(
          factor * scene.Cast(T_world_line.translation(), T_world_line.linear() * ray));
    }
  return keyframe;
}

// Of the points in the scene, metres: median and 95th percentile of the distance from the true
// height, where the surface is not steep.
std::pair<double, double> ErrorsOf(const DomeScene& scene, const ViewSurface& surface) {
  std::vector<double> errors_m;
  for (std::size_t i = 0; i < surface.size(); ++i) {
    if (!(surface.pixels[i].weight > 0)) continue;
    const Eigen::Vector3d p = surface.T_world_camera * surface.PointInCamera(i).cast<double>();
    const Eigen::Vector3d n = scene.Normal(p.x(), p.y());
    if (n.z() < 0.5) continue;
    errors_m.push_back(std::abs(n.z() * (p.z() - scene.Height(p.x(), p.y()))));
  }
  EXPECT_GT(errors_m.size(), 40000U);
  return {TakeQuantile(errors_m, 0.5), TakeQuantile(errors_m, 0.95)};
}

std::pair<double, double> ErrorsAfter(const Intrinsics& camera, double readout_s,
                                      double known_readout_s) {
  const DomeScene scene;
  Vector6d velocity_per_s;
  velocity_per_s << 0.4, -0.2, 0.3, 0.3, -0.2, 0.2;
  TrackingMap map;
  map.keyframes.push_back(MovingView(scene, testing::LookAt({0.4, 0.3, 1.0}, {0.5, 0.35, 0.0}),
                                     camera, velocity_per_s, readout_s, 1 / 1.02));
  JointRegistrationResult joint;
  joint.calibration.depth[kDepthReadout] = known_readout_s;
  joint.calibration.depth[kDepthScale] = 0.02;
  const auto surfaces = PrepareCorrectedViews(map, camera, joint, Pose::Identity(), {});
  EXPECT_EQ(surfaces.size(), 1U);
  EXPECT_TRUE(map.keyframes[0].data.view.depth_m.empty());
  return ErrorsOf(scene, surfaces.at(0));
}

Intrinsics Portrait() { return {480, 640, 525.0, 525.0, 239.5, 319.5, {}}; }

// Measured: 0.016 and 0.10 mm in landscape, 0.009 and 0.06 mm in portrait format; without the
// read-out 0.6 and 3 mm. With the nearest pixel in place of the four around the place: 0.09 and
// 0.6 mm.
TEST(CorrectedViewsTest, AMovingCamerasLinesAreSeenInOneInstant) {
  constexpr double kReadout_s = 0.02;
  for (const Intrinsics& camera : {Intrinsics{}, Portrait()}) {
    const auto [median_m, q95_m] = ErrorsAfter(camera, kReadout_s, kReadout_s);
    EXPECT_LT(median_m, 3e-5);
    EXPECT_LT(q95_m, 2e-4);
    EXPECT_GT(ErrorsAfter(camera, kReadout_s, 0.0).second, 2e-3);
  }
}

// The camera moves across the step, so that its lines see it up to a pixel beside where the
// instantaneous camera does.
TEST(CorrectedViewsTest, NothingIsMadeUpBetweenTheTwoSidesOfAnEdge) {
  constexpr double kReadout_s = 0.02;
  const Pose T_world_color = testing::LookAt({-0.1, 0, 1.0}, {-0.1, 0.0, 0.0});
  for (const int width : {640, 320}) {
    const Intrinsics camera = Resized({}, width, width * 3 / 4);
    Vector6d velocity_per_s = Vector6d::Zero();
    velocity_per_s[3] = 0.4;
    TrackingMap map;
    map.keyframes.push_back(
        MovingView(StepScene(), T_world_color, camera, velocity_per_s, kReadout_s, 1));
    JointRegistrationResult joint;
    joint.calibration.depth[kDepthReadout] = kReadout_s;
    const auto surfaces = PrepareCorrectedViews(map, camera, joint, Pose::Identity(), {});
    int between = 0, on_box = 0, on_floor = 0;
    for (std::size_t i = 0; i < surfaces.at(0).size(); ++i) {
      if (!(surfaces[0].pixels[i].weight > 0)) continue;
      const double z_m = (T_world_color * surfaces[0].PointInCamera(i).cast<double>()).z();
      const bool low = std::abs(z_m) < 1e-3, high = std::abs(z_m - StepScene::kBox_m) < 1e-3;
      on_floor += low ? 1 : 0;
      on_box += high ? 1 : 0;
      between += low || high ? 0 : 1;
    }
    EXPECT_EQ(between, 0) << width;
    EXPECT_GT(on_box, 10000) << width;
    EXPECT_GT(on_floor, 10000) << width;
  }
}

// Keyframes are kept at working resolution once no keypoint is observed in them any more.
TEST(CorrectedViewsTest, DepthAtWorkingResolutionGivesTheSameSurface) {
  for (const int width : {640, 848}) {
    const Intrinsics camera = Resized({}, width, 480);
    Vector6d velocity_per_s;
    velocity_per_s << 0.4, -0.2, 0.3, 0.3, -0.2, 0.2;
    TrackingMap full;
    full.keyframes.push_back(MovingView(DomeScene(),
                                        testing::LookAt({0.4, 0.3, 1.0}, {0.5, 0.35, 0.0}), camera,
                                        velocity_per_s, 0.02, 1));
    TrackingMap reduced = full;
    cv::Mat& depth_m = reduced.keyframes[0].data.view.depth_m;
    depth_m = WorkingDepth(depth_m, camera, ViewSurfaceOptions().depth_noise);
    ASSERT_LT(depth_m.cols, camera.width);
    JointRegistrationResult joint;
    joint.calibration.depth[kDepthReadout] = 0.02;
    const auto a = PrepareCorrectedViews(full, camera, joint, Pose::Identity(), {});
    const auto b = PrepareCorrectedViews(reduced, camera, joint, Pose::Identity(), {});
    ASSERT_EQ(a.at(0).size(), b.at(0).size());
    for (std::size_t i = 0; i < a[0].size(); ++i) {
      ASSERT_EQ(a[0].pixels[i].inverse_depth, b[0].pixels[i].inverse_depth) << i;
      ASSERT_EQ(a[0].pixels[i].weight, b[0].pixels[i].weight) << i;
    }
  }
}

}  // namespace
}  // namespace plumb
