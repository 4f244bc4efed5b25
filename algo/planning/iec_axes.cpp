// SPDX-License-Identifier: Apache-2.0
#include "algo/planning/iec_axes.hpp"

#include "algo/base/names.hpp"

namespace plumb {

Eigen::Matrix3d IecFromPatient(PatientPosture posture) {
  const bool head_first =
      posture == PatientPosture::kHeadFirstSupine || posture == PatientPosture::kHeadFirstProne;
  const bool supine =
      posture == PatientPosture::kHeadFirstSupine || posture == PatientPosture::kFeetFirstSupine;
  // The head points to the gantry or away from it; the back points down or up; what is to the
  // right then keeps the axes right-handed.
  const double along = head_first ? 1.0 : -1.0, up = supine ? -1.0 : 1.0;
  Eigen::Matrix3d R = Eigen::Matrix3d::Zero();
  R(0, 0) = -along * up;
  R(1, 2) = along;
  R(2, 1) = up;
  return R;
}

std::optional<PatientPosture> PostureOfPosition(std::string_view position) {
  return Named<PatientPosture>(position);
}

}  // namespace plumb
