// SPDX-License-Identifier: Apache-2.0
#include "algo/comparison/motion_uncertainty.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "algo/base/statistics.hpp"
#include "algo/base/units.hpp"
#include "algo/sensor_model/image_error_sigmas.hpp"
#include "words/comparison.hpp"

namespace plumb {
namespace {

// Scale error of a marker map: 0.0 to 0.8 permille over 23 sweeps of four units with estimated tone
// curves and exact prints. Printers err by 0.3 to 0.5 % in scale: two units with hard noise, which
// includes that, gave maps 3.0 to 4.7 permille too long. The markers of both maps share this error,
// so comparing the maps does not show it. 0.5 % at 95 %.
constexpr double kScaleSigma = 0.0025;
// Without the printer's part, which acts over the whole way from the markers to the body where
// nothing else states that way: prints must then be measured.
constexpr double kMapScaleSigma = 0.0005;
// A body lies off against its markers by what all sweeps of a unit repeat, such as an error between
// the clocks of colour and depth: 0.5, 0.5 and 1.6 mm along the sweep and 0.1 to 0.5 mm across it
// on three simulated units. It cancels out between sweeps, and not against a CT.
constexpr double kRepeatedShift_m = 0.8 * kMillimetre;
constexpr double kRepeatedHeight_m = 0.3 * kMillimetre;

// For scenes without a SensorSensitivity. Depth is registered to colour by terms that each
// sweep estimates again, so two sweeps may agree at the markers and place the body differently: by
// 0.3 to 0.4 mm and 0.01 to 0.03 deg for each sweep (RMS, small suite of unit 71).
constexpr double kSensorShift_m = 0.4 * kMillimetre;
constexpr double kSensorAngle_rad = 0.03 * kDegree;

// The surface of a breathing body is merged from different moments of the breath. Measured on four
// simulated pairs whose bodies breathed in both sweeps (estimated rise 3.3 to 6.0 mm each): the
// shifts were off by 0.07 and the angles by 0.07 per metre of the rise, beyond the errors of the
// same pairs without breathing.
constexpr double kBreathingShift = 0.1;        // of the rise of chest and belly
constexpr double kBreathingAngle_per_m = 0.1;  // times that rise

// The longitudinal place of a surface between slices, by their spacing (standard deviation).
constexpr double kSliceShift = 0.1;

// The plane of a marker is off by the maps' distortion over the first length, its direction within
// the plane by the distortion over the second. Measured on 13 sweeps of three units, where the
// distortion was 0.3 to 3 mm: tilts of 0.09 to 0.3 deg about an axis (RMS), rotations of 0.01 to
// 0.05 deg.
constexpr double kTiltLength_m = 0.3;
constexpr double kTurnLength_m = 2.0;

Matrix6d Isotropic(double angle_rad, double shift_m) {
  Vector6d variance;
  variance << Eigen::Vector3d::Constant(angle_rad * angle_rad),
      Eigen::Vector3d::Constant(shift_m * shift_m);
  return variance.asDiagonal();
}

// The maps disagree between the markers as much as at the markers. The body is one more place in
// that field of distortion, and the field at the body is not reduced by averaging over many
// markers. The stretch that makes the maps equally long is included, because its cause need not
// affect the body in the same way. A field that changes over the spread of the markers rotates the
// body by its size over that length, about the markers: a body far beside them is shifted, too. Of
// a real recording cut in two, whose body lay half a metre from markers with a spread of 0.25 m,
// the height was off by 4.9 mm where 2.5 mm were stated without that.
Matrix6d DistortionAt(const Alignment& alignment, const Eigen::Vector3d& moved) {
  Matrix6d covariance = Matrix6d::Zero();
  if (alignment.spread_m > 0) {
    const double angle_rad = std::sqrt(alignment.distortion.trace() / 3.0) / alignment.spread_m;
    covariance = CovarianceAbout(Isotropic(angle_rad, 0.0), alignment.centre_m, moved);
  }
  covariance.bottomRightCorner<3, 3>() += alignment.distortion;
  return covariance;
}

// Both body positions contain the common scale error of the maps, so their distance is off in
// proportion. In addition, the uncertainty of the relative stretch grows with the distance from the
// markers' centre.
//
// @param doubt  A fraction that may be wrong as a whole, so that it is taken for the half-width of
// a
//         95 % interval.
Matrix6d ScaleOver(const Alignment& alignment, double sigma, double doubt,
                   const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d way = std::hypot(sigma, doubt / kCover95) * (to - from);
  const Eigen::Vector3d arm = alignment.stretch_sigma * (to - alignment.centre_m);
  Matrix6d covariance = Matrix6d::Zero();
  covariance.bottomRightCorner<3, 3>() = way * way.transpose() + arm * arm.transpose();
  return covariance;
}

// A frame that is rotated by a small twist f changes the motion into F M F^-1, so the motion is off
// by f - Ad(M) f, which vanishes where the body did not move. The frame is the pose of one marker,
// which has the maps' distortion at its place.
Matrix6d FrameOf(const Alignment& alignment, const Pose& T_motion, const Eigen::Vector3d& moved) {
  // variance of one of the two maps
  const double variance = alignment.distortion.trace() / 3.0 / 2.0;
  Matrix6d at_origin = Isotropic(std::sqrt(variance) / kTiltLength_m, std::sqrt(variance));
  at_origin(2, 2) = variance / (kTurnLength_m * kTurnLength_m);
  const Matrix6d frame = CovarianceAbout(at_origin, Eigen::Vector3d::Zero(), moved);
  // Adjoint of the motion about the moved centroid.
  const Pose T = Eigen::Translation3d(-moved) * T_motion * Eigen::Translation3d(moved);
  Matrix6d adjoint = Matrix6d::Zero();
  adjoint.topLeftCorner<3, 3>() = T.linear();
  adjoint.bottomRightCorner<3, 3>() = T.linear();
  adjoint.bottomLeftCorner<3, 3>() = Skew(T.translation()) * T.linear();
  const Matrix6d jacobian = Matrix6d::Identity() - adjoint;
  return jacobian * frame * jacobian.transpose();
}

/// Of patterns that are independent of each other, each of that half-width.
template <std::size_t N>
Matrix6d OfPatterns(double u95_m, const std::array<Vector6d, N>& feigned) {
  Matrix6d covariance = Matrix6d::Zero();
  for (const Vector6d& per_metre : feigned) {
    const Vector6d motion = u95_m / kCover95 * per_metre;
    covariance += motion * motion.transpose();
  }
  return covariance;
}

// A reference from a planning CT or another room shares no error with the current scan: the frame
// and the scale of each scan's map count in full, and what the files do not state comes on top.
void AddPlanned(const UncertaintyInput& input, const Eigen::Vector3d& moved,
                MotionUncertainty& parts) {
  const PlannedUncertainty& planned = *input.planned;
  parts.frame.setZero();
  parts.scale.setZero();
  for (const PlaceUncertainty& scan : planned.scans) {
    parts.frame +=
        CovarianceAbout(Isotropic(scan.frame_sigma_rad, scan.frame_sigma_m), scan.origin_m, moved);
    parts.scale +=
        ScaleOver(input.alignment, kMapScaleSigma, input.scale_doubt, scan.origin_m, moved);
    parts.room +=
        CovarianceAbout(Isotropic(scan.room_u95_rad / kCover95, scan.room_u95_m / kCover95),
                        planned.isocentre_m, moved);
  }
  const FeignedMotions& feigned = planned.feigned;
  parts.skin = OfPatterns(planned.skin_u95_m, std::array{feigned.skin});
  parts.clothing = OfPatterns(planned.surface.clothing_u95_m, feigned.clothing);
  parts.ct_breathing = OfPatterns(planned.surface.ct_breathing_u95_m, feigned.breathing);
  Vector6d repeated = Vector6d::Zero();
  repeated.tail<3>() << kRepeatedShift_m, kRepeatedShift_m, kRepeatedHeight_m;
  parts.sensor += Matrix6d(repeated.cwiseAbs2().asDiagonal());
  Vector6d slices = Vector6d::Zero();
  slices[4] = kSliceShift * planned.slice_spacing_m;
  parts.slices = slices * slices.transpose();
}

}  // namespace

std::vector<std::pair<const char*, const Matrix6d*>> MotionUncertainty::Parts() const {
  std::vector<std::pair<const char*, const Matrix6d*>> parts = {
      {"surface", &surface}, {"markers", &markers}, {"distortion", &distortion}, {"scale", &scale},
      {"frame", &frame},     {"sensor", &sensor},   {"breathing", &breathing}};
  // The threshold of the skin always counts for a planning CT.
  if (!skin.isZero() || !room.isZero()) parts.emplace_back("room", &room);
  if (!skin.isZero()) {
    parts.emplace_back("skin", &skin);
    parts.emplace_back("slices", &slices);
  }
  if (!clothing.isZero()) parts.emplace_back("clothing", &clothing);
  if (!ct_breathing.isZero()) parts.emplace_back("ct_breathing", &ct_breathing);
  return parts;
}

Message LargestCause(const MotionUncertainty& uncertainty, const Alignment& alignment,
                     bool of_turns) {
  namespace words = say::comparison;
  const double off_m = std::sqrt(alignment.distortion.trace() / 3.0);
  const Message of_markers = words::CauseMarkers(off_m / kMillimetre);
  const std::array<std::pair<const Matrix6d*, Message>, 12> causes = {{
      {&uncertainty.surface, words::CauseSurface()},
      {&uncertainty.markers, of_markers},
      {&uncertainty.distortion, of_markers},
      {&uncertainty.scale, words::CauseScale()},
      {&uncertainty.frame, words::CauseFrame()},
      {&uncertainty.sensor, words::CauseSensor()},
      {&uncertainty.breathing, words::CauseBreathing()},
      {&uncertainty.room, words::CauseRoom()},
      {&uncertainty.skin, words::CauseSkin()},
      {&uncertainty.slices, words::CauseSlices()},
      {&uncertainty.clothing, words::CauseClothing()},
      {&uncertainty.ct_breathing, words::CauseCtBreathing()},
  }};
  const auto size = [&](const auto& cause) {
    return of_turns ? cause.first->template topLeftCorner<3, 3>().trace()
                    : cause.first->template bottomRightCorner<3, 3>().trace();
  };
  return std::ranges::max_element(causes, {}, size)->second;
}

Matrix6d CovarianceAbout(const Matrix6d& covariance, const Eigen::Vector3d& from_m,
                         const Eigen::Vector3d& to_m) {
  Matrix6d jacobian = Matrix6d::Identity();
  jacobian.bottomLeftCorner<3, 3>() = -Skew(to_m - from_m);
  return jacobian * covariance * jacobian.transpose();
}

Matrix6d CovarianceTurned(const Matrix6d& covariance, const Eigen::Matrix3d& R) {
  Matrix6d turn = Matrix6d::Zero();
  turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = R;
  return turn * covariance * turn.transpose();
}

MotionUncertainty Uncertainty(const UncertaintyInput& input) {
  const Eigen::Vector3d moved = input.T_motion * input.centroid_m;
  const Alignment& alignment = input.alignment;
  MotionUncertainty parts;
  parts.surface = input.surface;
  parts.markers = CovarianceAbout(alignment.covariance, alignment.centre_m, moved);
  parts.distortion = DistortionAt(alignment, moved);
  parts.scale = ScaleOver(alignment, kScaleSigma, input.scale_doubt, input.centroid_m, moved);
  parts.frame = FrameOf(alignment, input.T_motion, moved);
  // Both sweeps contribute.
  parts.sensor = input.sensor.value_or(2.0 * Isotropic(kSensorAngle_rad, kSensorShift_m));
  for (const DepthSensor sensor : input.classes) {
    const ImageErrorSigmas& left = ImageErrorSigmasOf(sensor);
    Vector6d sigmas = Vector6d::Zero();
    sigmas << left.body_tilt_rad, left.body_tilt_rad, left.body_turn_rad, left.body_shift_m,
        left.body_shift_m, 0.0;
    parts.sensor += Matrix6d(sigmas.cwiseAbs2().asDiagonal());
  }
  parts.breathing =
      Isotropic(kBreathingAngle_per_m * input.breathing_m, kBreathingShift * input.breathing_m);
  if (input.planned) AddPlanned(input, moved, parts);
  return parts;
}

}  // namespace plumb
