// SPDX-License-Identifier: Apache-2.0
// What a scene was made of that no camera has seen: the structure set and the plan of a planning
// CT.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include <Eigen/Core>

#include "algo/base/posture.hpp"
#include "algo/base/units.hpp"

namespace plumb {

/// How far the surface that a camera sees may lie from the skin of the CT, as a person states it:
/// half-widths of 95 % intervals. Zero: bare, and in the same breath.
struct StatedSurface {
  /// Along the skin's normal, by what is worn or lies there at the CT or at the treatment.
  double clothing_u95_m = 0.0;
  /// In height, by how full the lungs were at the CT and are at the treatment.
  double ct_breathing_u95_m = 0.0;
};

/// The most that can be stated, of each.
inline constexpr double kMostStated_m = 30 * kMillimetre;

/// Of a scene in IEC axes. No name and no identifier of the patient.
struct PlanningSource {
  std::string roi;  ///< Name of the contour that is the surface.
  PatientPosture posture = PatientPosture::kHeadFirstSupine;  ///< As the plan states it.
  Eigen::Vector3d isocentre_mm = Eigen::Vector3d::Zero();     ///< In the axes of the CT (LPS).
  std::string beam;  ///< The beam that was asked for; empty: all beams share the isocentre.
  std::string plan_label, plan_date, approval;  ///< As the plan states them; the date is YYYYMMDD.
  std::string plan_uid, structure_set_uid, frame_of_reference_uid;
  std::int64_t slices = 0;
  double slice_spacing_m = 0.0;
  std::int64_t parts_apart = 0;     ///< Contours beside the largest of their slice that were kept.
  std::int64_t parts_left_out = 0;  ///< Crumbs, and parts at the height of the couch.
  double support_m = 0.0;           ///< Height of what the body lies on, z of the scene's frame.
  /// Half-width of the 95 % interval of the skin's place along its normal, since the threshold by
  /// which the skin was found in the CT is not stated.
  double skin_u95_m = 1 * kMillimetre;
  /// Hounsfield units by which the skin was found in CT images; not set: a contour is the surface.
  std::optional<double> skin_threshold_hu = {};
  StatedSurface surface = {};
};

}  // namespace plumb
