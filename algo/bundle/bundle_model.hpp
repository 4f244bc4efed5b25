// SPDX-License-Identifier: Apache-2.0
// The residuals of bundle adjustment with their derivatives: projections of points into a
// calibrated camera.
#pragma once

#include <array>

#include <Eigen/Core>

#include "algo/base/intrinsics.hpp"
#include "algo/base/pose.hpp"
#include "algo/sensor_calibration/calibration_prior.hpp"
#include "algo/types/marker.hpp"

namespace plumb::bundle {

[[nodiscard]] Eigen::Vector2d Inward(const ImageCorners& corners, std::size_t i);

inline constexpr int kCamera = 6;  ///< Unknowns of a keyframe: its twist.
inline constexpr int kLensAndReadout = kReadoutAt + 1;

using DepthRow = Eigen::Matrix<double, 1, CalibrationModel::kDepthSize>;

/// Smallest depth in front of the camera for which projections are computed.
inline constexpr double kNearestPoint_m = 0.02;

/// Of a rotation vector, to second order; the twists stay small because each call linearises again.
[[nodiscard]] Eigen::Matrix3d RightJacobian(const Eigen::Vector3d& w);

/// Pose of a keyframe's camera: T_world_camera = T_world_camera0 * PoseFromTwist(twist), moving
/// with `velocity_per_s`.
struct CameraState {
  Pose T_camera0_world = Pose::Identity();
  Vector6d velocity_per_s = Vector6d::Zero();
  Vector6d twist = Vector6d::Zero();

  /// Quantities of `twist`, computed once because every residual of the camera uses them.
  void Prepare();
  Pose T_camera_world = Pose::Identity();
  Eigen::Matrix3d R_inverse = Eigen::Matrix3d::Identity();  ///< Rotation of the twist, inverted.
  Eigen::Matrix3d J_right = Eigen::Matrix3d::Identity();    ///< Right Jacobian of that rotation.
};

/// A point in the camera frame some time after the stamp, with derivatives.
struct SeenPoint {
  Eigen::Vector3d p;
  Matrix3x6d J_pose;
  Eigen::Matrix3d J_world;  ///< dp / dp_world
  Eigen::Vector3d J_time;   ///< dp / ddt
};
[[nodiscard]] SeenPoint See(const CameraState& camera, const Eigen::Vector3d& p_world, double dt_s);

/// Its pixel through the corrected lens, with derivatives with respect to the point and to
/// CalibrationModel::lens.
struct SeenPixel {
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3> J_point;
  Eigen::Matrix<double, 2, CalibrationModel::kLensSize> J_lens;
};
[[nodiscard]] SeenPixel ProjectCorrected(const Intrinsics& stated,
                                         const CalibrationModel::Lens& lens,
                                         const Eigen::Vector3d& p);

/// Fraction of the readout before or after the stamp at a pixel, from -0.5 to 0.5. A shutter reads
/// lines along the sensor's long side: the rows of a landscape image from top to bottom, the
/// columns of a portrait one from left to right (or, where the readout time is negative, the other
/// way).
[[nodiscard]] inline double ReadoutFraction(const Eigen::Vector2d& pixel,
                                            const Intrinsics& stated) {
  return ReadByColumns(stated) ? (pixel.x() + 0.5) / stated.width - 0.5
                               : (pixel.y() + 0.5) / stated.height - 0.5;
}

/// Prediction of a depth reading in the units of the measurement (in metres of the scene, a smaller
/// scene would give a lower cost).
struct PredictedDepth {
  double z_m = 0;
  double J_z = 0;  ///< With respect to the true depth.
  /// With respect to CalibrationModel::depth, including its times.
  DepthRow J_depth = DepthRow::Zero();
};
/// Position of a depth reading in its image.
struct DepthPlace {
  DepthPlace() = default;
  DepthPlace(const Eigen::Vector2d& pixel, const Intrinsics& stated);
  Eigen::Vector2d centred;  ///< CentredCoordinates()
  FieldRow products;        ///< FieldProducts()
  double row_fraction = 0;
};
/// @param seen  The point at the time of the reading.
[[nodiscard]] PredictedDepth PredictDepth(const CalibrationModel& calibration,
                                          const SeenPoint& seen, const DepthPlace& place);
/// The same without derivatives.
[[nodiscard]] double PredictDepthOnly(const CalibrationModel& calibration, double z_true_m,
                                      const DepthPlace& place);

/// A keypoint's depth reading.
struct DepthReading {
  double z_m = 0;                        ///< At the keypoint's pixel; 0 without depth.
  Eigen::Vector2d inverse_slope_per_px;  ///< Slope of the inverse depth around the pixel.
};
/// The reading at the place where the depth image shows the keypoint. That is beside the keypoint's
/// pixel, because depth is registered with an error and taken at another time; the plane around the
/// pixel is extrapolated to it.
struct DepthBeside {
  DepthBeside(const DepthReading& reading, const Eigen::Vector2d& offset_px);
  double z_m;
  Eigen::RowVector2d J_offset;  ///< Metres per pixel.
};

inline constexpr double kKeypointLossScale = 2.0;  ///< Cauchy scale in standard deviations.
inline constexpr double kCornerLossScale = 3.0;

}  // namespace plumb::bundle
