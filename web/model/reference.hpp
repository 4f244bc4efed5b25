// SPDX-License-Identifier: Apache-2.0
// Versions of a patient's reference, and their plans.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "algo/base/names.hpp"
#include "algo/verdict/default_tolerance.hpp"
#include "web/model/wall_clock.hpp"

namespace plumb {

struct Tolerance {
  double shift_mm = kDefaultShiftTolerance_mm;
  double rotation_deg = kDefaultRotationTolerance_deg;
};

/// Settings by the physicist before a reference is approved.
struct ReferencePlan {
  std::vector<std::array<double, 2>>
      region_m;  ///< Polygon in the reference marker's frame; empty: the segmented body.
  std::optional<std::array<double, 3>>
      isocentre_m;  ///< Reference marker's frame; not set: centroid of the region.
  Tolerance tolerance;
  std::string posture = "HFS";  ///< One of kPostures.
  bool couch_markers = false;   ///< Markers are fixed to the couch: no shifts are calculated.
  /// As StatedSurface has them; of a planning CT, and zero of any other reference.
  double clothing_mm = 0.0, ct_breathing_mm = 0.0;
};

/// What a reference was made of.
enum class ReferenceSource { kSweep, kPlanningCt };
template <>
inline constexpr auto kNamesOf<ReferenceSource> =
    NamesUpTo<ReferenceSource::kPlanningCt>({"sweep", "planning_ct"});

/// Where a reference comes from; the same for all versions that only change its plan.
struct ReferenceOrigin {
  ReferenceSource source = ReferenceSource::kSweep;
  /// Keyed hash of the Patient ID in the files of a planning CT; empty for a sweep, and for files
  /// without one.
  std::string patient_hash = {};
  /// Why it was not plain that the files are this patient's, for the log; a person confirmed it.
  /// Never read back.
  Message confirmed = {};
};

/// Immutable once approved; a change of plan creates a new version.
struct Reference {
  std::string id;
  std::string patient_id;
  int version = 1;      ///< Increases within a patient.
  std::string scan_id;  ///< Its scene is DIR/scans/SCAN_ID/scene.
  WallClock::time_point created_at;
  std::string created_by;
  Message reason;
  /// Counts the plans saved into this version; saving and approving state which one was read.
  int revision = 1;
  std::string digest = {};  ///< SHA-256 of the signed data: scan, version and plan.
  std::string planned_by;
  std::string approved_by;  ///< Empty for a draft; "auto" for the demo's.
  std::optional<WallClock::time_point> approved_at = {};
  ReferencePlan plan = {};
  ReferenceOrigin origin = {};
  Message unreadable = {};  ///< Why the stored plan cannot be read; `plan` is then invalid.
};

/// A draft that is to be planned or approved.
struct WaitingReference {
  std::string reference_id;
  std::string patient_id;
  std::string patient_code;
  int version = 1;
  std::string planned_by;  ///< Empty: it is to be planned; otherwise it is to be approved.
};

}  // namespace plumb
