// SPDX-License-Identifier: Apache-2.0
#include "algo/comparison/correction.hpp"

#include <algorithm>
#include <cmath>

#include "algo/base/units.hpp"
#include "algo/comparison/direction_words.hpp"

namespace plumb {
namespace {

using namespace couch;  // NOLINT: the names of its components

constexpr double kNormal95 = 1.959964;  // half-width of a 95 % interval in standard deviations

// Standard deviations of the couch vector, to first order by central differences. The covariance is
// a left perturbation (w, t) about the moved centroid m: p -> m + R(w)(p - m) + t.
Vector6d CouchSigmas(const Pose& T_motion, const Matrix6d& covariance,
                     const Eigen::Vector3d& moved_centroid,
                     const Eigen::Vector3d& isocentre_reference, const Pose& T_iec_reference) {
  constexpr double kStep = 1e-6;  // rad or m; relative error by rounding 1e-10, by curvature 1e-12
  Matrix6d jacobian;
  for (int i = 0; i < 6; ++i) {
    std::array<Vector6d, 2> side;
    for (int s = 0; s < 2; ++s) {
      Vector6d twist = Vector6d::Zero();
      twist[i] = s == 0 ? -kStep : kStep;
      const Pose T_perturbed = PoseAbout(moved_centroid, twist) * T_motion;
      side[static_cast<std::size_t>(s)] =
          CouchVector(T_perturbed, isocentre_reference, T_iec_reference);
    }
    jacobian.col(i) = (side[1] - side[0]) / (2 * kStep);
  }
  return (jacobian * covariance * jacobian.transpose()).diagonal().cwiseMax(0.0).cwiseSqrt();
}

CouchNumbers NumbersOf(const Vector6d& couch, MarkerKind kind) {
  CouchNumbers numbers;
  if (kind == MarkerKind::kRoom) {
    numbers.lateral_mm = couch[kLateral] / kMillimetre;
    numbers.longitudinal_mm = couch[kLongitudinal] / kMillimetre;
    numbers.vertical_mm = couch[kVertical] / kMillimetre;
  }
  numbers.pitch_deg = couch[kPitch] / kDegree;
  numbers.roll_deg = couch[kRoll] / kDegree;
  numbers.yaw_deg = couch[kYaw] / kDegree;
  return numbers;
}

}  // namespace

Vector6d CouchVector(const Pose& T_motion, const Eigen::Vector3d& isocentre_reference,
                     const Pose& T_iec_reference) {
  const Pose T_correction = T_iec_reference * T_motion.inverse() * T_iec_reference.inverse();
  const Eigen::Vector3d isocentre_iec = T_iec_reference * isocentre_reference;
  const Eigen::Matrix3d R = T_correction.linear();
  Vector6d couch;
  couch.head<3>() = T_correction * isocentre_iec - isocentre_iec;
  couch[kPitch] = std::asin(std::clamp(R(2, 1), -1.0, 1.0));
  couch[kRoll] = std::atan2(-R(2, 0), R(2, 2));
  couch[kYaw] = std::atan2(-R(0, 1), R(1, 1));
  return couch;
}

Correction CorrectionOf(const Pose& T_motion, const Matrix6d& covariance,
                        const Eigen::Vector3d& centroid, const Eigen::Vector3d& isocentre_reference,
                        const std::optional<Pose>& T_iec_reference, MarkerKind kind,
                        std::optional<PatientPosture> posture,
                        const std::optional<PatientAxes>& patient) {
  const Pose T_axes = T_iec_reference.value_or(Pose::Identity());
  const Vector6d couch = CouchVector(T_motion, isocentre_reference, T_axes);
  Correction correction;
  correction.isocentre_m = isocentre_reference;
  correction.value = NumbersOf(couch, kind);
  correction.u95 = NumbersOf(kNormal95 * CouchSigmas(T_motion, covariance, T_motion * centroid,
                                                     isocentre_reference, T_axes),
                             kind);
  correction.words = T_iec_reference ? WordsInRoom(couch, kind, posture)
                                     : WordsWithoutRoom(couch, kind, posture, patient);
  return correction;
}

}  // namespace plumb
