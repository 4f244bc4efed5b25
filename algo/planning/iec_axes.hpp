// SPDX-License-Identifier: Apache-2.0
// From the axes of a CT to those of the treatment room.
#pragma once

#include <optional>
#include <string_view>

#include <Eigen/Core>

#include "algo/base/posture.hpp"

namespace plumb {

/// The rotation from DICOM's patient axes (LPS: to the patient's left, back and head) to IEC
/// 61217's fixed ones (to the right of a viewer who faces the gantry, to the gantry, up), for a
/// patient who lies so on a couch at 0 deg.
[[nodiscard]] Eigen::Matrix3d IecFromPatient(PatientPosture posture);

/// Nothing for positions other than HFS, HFP, FFS and FFP, such as decubitus and sitting.
[[nodiscard]] std::optional<PatientPosture> PostureOfPosition(std::string_view position);

}  // namespace plumb
