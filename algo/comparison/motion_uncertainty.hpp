// SPDX-License-Identifier: Apache-2.0
// Uncertainty of a body motion: one covariance for each cause, and their sum.
#pragma once

#include <array>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "algo/base/message.hpp"
#include "algo/base/pose.hpp"
#include "algo/comparison/scene_alignment.hpp"
#include "algo/sensor_model/depth_sensor.hpp"
#include "algo/types/planning_source.hpp"

namespace plumb {

/// Covariances of a body motion by cause. Each holds the rotation vector (rad), then the
/// translation (m), in the reference frame, as a left perturbation about the moved centroid of the
/// region. The causes are independent.
struct MotionUncertainty {
  Matrix6d surface = Matrix6d::Zero();  ///< Registration of the two surfaces to each other.
  Matrix6d markers = Matrix6d::Zero();  ///< Fit of the two marker maps to each other.
  /// Distortion of the marker maps at a place between the markers.
  Matrix6d distortion = Matrix6d::Zero();
  /// Scale error of the maps over the distance that the body moved.
  Matrix6d scale = Matrix6d::Zero();
  Matrix6d frame = Matrix6d::Zero();  ///< Pose of the reference marker in its own map.
  /// Calibrations of the two sensors: see SharedSensor.
  Matrix6d sensor = Matrix6d::Zero();
  Matrix6d breathing = Matrix6d::Zero();  ///< Breathing during the two sweeps.
  /// The calibration of the room, for a planning CT and a reference of another room; for a planning
  /// CT also the threshold by which the skin was found and the spacing of the slices.
  Matrix6d room = Matrix6d::Zero(), skin = Matrix6d::Zero(), slices = Matrix6d::Zero();
  /// What is stated of a planning CT: what is worn, and its breath against the treatment's.
  Matrix6d clothing = Matrix6d::Zero(), ct_breathing = Matrix6d::Zero();

  [[nodiscard]] Matrix6d Total() const {
    return surface + markers + distortion + scale + frame + sensor + breathing + room + skin +
           slices + clothing + ct_breathing;
  }
  /// The causes with their names, in a fixed order; the last five only where they take part.
  [[nodiscard]] std::vector<std::pair<const char*, const Matrix6d*>> Parts() const;
};

/// How uncertain the place of a scan in its room is.
struct PlaceUncertainty {
  double room_u95_m = 0.0, room_u95_rad = 0.0;  ///< Of T_iec_reference, at the isocentre.
  /// Of the reference marker in the scan's map; zero where the room's markers place it.
  double frame_sigma_m = 0.0, frame_sigma_rad = 0.0;
  Eigen::Vector3d origin_m = Eigen::Vector3d::Zero();  ///< That marker in the reference frame.
};

/// The motions that a surface that lies elsewhere by up to 1 m would feign: each a rotation vector
/// and a translation about the moved centroid, of a pattern by itself.
struct FeignedMotions {
  Vector6d skin = Vector6d::Zero();  ///< Farther out everywhere.
  /// Farther out everywhere; tilted as by that over one half of it, along and across the couch.
  std::array<Vector6d, 3> clothing = {Vector6d::Zero(), Vector6d::Zero(), Vector6d::Zero()};
  /// Higher everywhere; tilted as by that over one half of it, along the couch.
  std::array<Vector6d, 2> breathing = {Vector6d::Zero(), Vector6d::Zero()};
};

/// What is added where scans are joined by calibrations of rooms.
struct PlannedUncertainty {
  std::vector<PlaceUncertainty> scans;  ///< One for a planning CT, two for two rooms.
  Eigen::Vector3d isocentre_m = Eigen::Vector3d::Zero();  ///< Of the rooms, reference frame.
  FeignedMotions feigned = {};
  double skin_u95_m = 0.0, slice_spacing_m = 0.0;
  StatedSurface surface = {};
};

/// Input of Uncertainty(). Borrowed for the call.
struct UncertaintyInput {
  const Alignment& alignment;
  const Matrix6d& surface;           ///< SurfaceMotion::covariance, about the moved centroid.
  Pose T_motion = Pose::Identity();  ///< p_current = T_motion * p_reference
  /// Centroid of the region in the reference frame.
  Eigen::Vector3d centroid_m = Eigen::Vector3d::Zero();
  /// SharedSensor::covariance; absent where a scene has no sensitivity.
  std::optional<Matrix6d> sensor;
  /// Classes of the sensors, where they are known: one for each scan.
  std::vector<DepthSensor> classes = {};
  double scale_doubt = 0.0;  ///< The larger of the scenes' Scene::scale_doubt.
  double breathing_m = 0.0;  ///< Rise of chest and belly, root of the squares of both sweeps.
  std::optional<PlannedUncertainty> planned = {};  ///< Where rooms join the scans.
};

[[nodiscard]] MotionUncertainty Uncertainty(const UncertaintyInput& input);

/// The largest of the causes, as a person may mend it.
/// @param of_turns  Of the rotations, otherwise of the shifts at the centroid.
[[nodiscard]] Message LargestCause(const MotionUncertainty& uncertainty, const Alignment& alignment,
                                   bool of_turns);

/// Moves a covariance (left perturbation) to another reference point.
[[nodiscard]] Matrix6d CovarianceAbout(const Matrix6d& covariance, const Eigen::Vector3d& from_m,
                                       const Eigen::Vector3d& to_m);

/// The same covariance in axes that are turned: what was e is R e.
[[nodiscard]] Matrix6d CovarianceTurned(const Matrix6d& covariance, const Eigen::Matrix3d& R);

}  // namespace plumb
