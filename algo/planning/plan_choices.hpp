// SPDX-License-Identifier: Apache-2.0
// What of a structure set and a plan counts, and whether they may be used together.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "algo/base/message.hpp"
#include "algo/base/posture.hpp"
#include "algo/planning/ct_skin.hpp"
#include "algo/types/treatment_plan.hpp"

namespace plumb {

/// Where and how the patient lies.
struct PlannedPlace {
  PatientPosture posture = PatientPosture::kHeadFirstSupine;
  Eigen::Vector3d isocentre_mm = Eigen::Vector3d::Zero();
  std::string beam;  ///< Empty where all beams share the isocentre.
};

// All throw DataError.

void RequireOnePatient(const StructureSet& structures, const TreatmentPlan& plan);
/// Refuses a plan that was made on another structure set, without one, or rejected.
void RequireUsablePlan(const StructureSet& structures, const TreatmentPlan& plan,
                       std::vector<Message>& warnings);
/// The same without a structure set to compare with.
void RequireUsablePlan(const TreatmentPlan& plan, std::vector<Message>& warnings);
/// Refuses images of another patient or position than the plan's.
void RequireImagesOfPlan(const CtSkin& images, const TreatmentPlan& plan,
                         PatientPosture planned_posture);
/// A frame that a file does not state cannot differ, but one of contour and structure set and the
/// plan's must be stated.
void RequireOneFrame(const StructureSet& structures, const PlannedRoi& roi,
                     const TreatmentPlan& plan);
/// Refuses positions that differ or are unknown, isocentres that differ unless a beam is chosen,
/// and a couch that is pitched or rolled.
[[nodiscard]] PlannedPlace ChoosePlace(const TreatmentPlan& plan,
                                       const std::optional<std::string>& beam,
                                       std::vector<Message>& warnings);
/// True if a contour of type EXTERNAL has points.
[[nodiscard]] bool HasExternal(const StructureSet& structures);
/// The one of that name, or the one of type EXTERNAL with contours. Proposes one where there is
/// none or more than one, and never takes it by itself.
[[nodiscard]] const PlannedRoi& ChooseRoi(const StructureSet& structures,
                                          const std::optional<std::string>& name);

}  // namespace plumb
