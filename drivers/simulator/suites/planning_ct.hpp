// SPDX-License-Identifier: Apache-2.0
// The planning CT of a simulated body: its contours and a plan, as a planning system would export
// them, with the quirks of real ones.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "algo/base/names.hpp"
#include "algo/base/pose.hpp"
#include "algo/base/posture.hpp"
#include "algo/base/units.hpp"
#include "algo/types/point_cloud.hpp"
#include "algo/types/treatment_plan.hpp"

namespace plumb::simulated {

/// What planning systems do. Those from kSeveralExternal on must be refused or asked about.
enum class CtQuirk : std::uint8_t {
  kCrumbs,      ///< Contours of some square millimetres.
  kCouchParts,  ///< Parts of the board within the external contour, beneath the sides.
  kCouch,       ///< A couch top within the external contour, wider than the body.
  kHoles,       ///< A contour inside another one.
  kClosed,      ///< The first point stands again at the end.
  kDense,       ///< So many points that the data stand as UN.
  kPoints,      ///< Contours that are points, and contours of two points.
  kShort,       ///< 30 cm of the body, as a CT of one region is.
  kMissingSlice,
  kEmptyRoi,  ///< A further external contour that has no points.
  kSeveralExternal,
  kNoExternal,
  kOblique,
  kLostPoints,  ///< Fewer points than stated.
  kDecubitus,
  kTwoPositions,
  kTwoIsocentres,
  kOtherFrame,
  kOtherPatient,
  kSuperseded,
  kRejected,
  kWrongPosition  ///< Feet first is stated for head first: only the surface can tell.
};

}  // namespace plumb::simulated

namespace plumb {
template <>
inline constexpr auto kNamesOf<simulated::CtQuirk> =
    NamesUpTo<simulated::CtQuirk::kWrongPosition>({"crumbs",
                                                   "couch_parts",
                                                   "couch",
                                                   "holes",
                                                   "closed",
                                                   "dense",
                                                   "points",
                                                   "short",
                                                   "missing_slice",
                                                   "empty_roi",
                                                   "several_external",
                                                   "no_external",
                                                   "oblique",
                                                   "lost_points",
                                                   "decubitus",
                                                   "two_positions",
                                                   "two_isocentres",
                                                   "other_frame",
                                                   "other_patient",
                                                   "superseded",
                                                   "rejected",
                                                   "wrong_position"});
}  // namespace plumb

namespace plumb::simulated {

struct PlanningCtOptions {
  PatientPosture posture = PatientPosture::kHeadFirstSupine;
  Eigen::Vector3d isocentre_mm = {72.5, -304.3, -9.3};  ///< In the axes of the CT.
  double spacing_m = 3 * kMillimetre;
  double skin_m = 0.0;  ///< The contour lies that far outside the skin.
  double phase = 0.0;   ///< Place of the slices, in spacings.
  std::vector<CtQuirk> quirks = {};
};

/// IEC axes to the patient's, stated here once more as the table of the standard, so that an error
/// of the reader's table shows.
[[nodiscard]] Eigen::Vector3d PatientOf(PatientPosture posture, const Eigen::Vector3d& iec);

/// @param surface  A closed mesh, with normals if `skin_m` is not 0.
/// @param T_iec_surface  To IEC axes with the isocentre at the origin: how the patient lies.
[[nodiscard]] std::pair<StructureSet, TreatmentPlan> MakePlanningCt(
    const TriangleMesh& surface, const Pose& T_iec_surface, const PlanningCtOptions& options);

}  // namespace plumb::simulated
