// SPDX-License-Identifier: Apache-2.0
// What Plumb reads of a planning system's structure set and plan, as the files state it: nothing is
// checked yet. Lengths in millimetres in the axes of the CT (LPS), as in the files.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace plumb {

/// Who and what a file is about. The identifier of the patient is compared and not kept.
struct PlanningFile {
  std::string class_uid, instance_uid, patient_id, patient_name;
  std::string label, date;  ///< The date is YYYYMMDD, and HHMMSS behind a space where stated.
  std::string frame_of_reference_uid;  ///< Empty where the file states none.
};

struct PlannedContour {
  std::string kind;                 ///< "CLOSED_PLANAR" is a part of a surface.
  std::int64_t stated_points = -1;  ///< -1: not stated.
  std::vector<Eigen::Vector3d> points_mm;
};

struct PlannedRoi {
  std::int64_t number = 0;
  std::string name, type;              ///< The type is such as "EXTERNAL"; it may be missing.
  std::string frame_of_reference_uid;  ///< Empty where it is not stated.
  std::vector<PlannedContour> contours = {};
};

struct StructureSet {
  PlanningFile file;
  std::vector<PlannedRoi> rois;
  /// The instances of the images on which it was drawn, by series, where it names them.
  std::map<std::string, std::vector<std::string>> image_uids = {};
};

struct PlannedBeam {
  std::int64_t number = 0;
  std::string name;
  std::optional<std::int64_t> setup = {};  ///< The patient setup that it refers to.
  std::optional<Eigen::Vector3d> isocentre_mm = {};
  double couch_deg = 0.0, pitch_deg = 0.0, roll_deg = 0.0;  ///< Of its first control point.
};

struct PatientSetup {
  std::int64_t number = 0;
  std::string position;           ///< Such as "HFS"; empty where it is not stated.
  bool has_displacement = false;  ///< A displacement of the table top is planned.
};

struct TreatmentPlan {
  PlanningFile file;
  std::string geometry;           ///< "PATIENT" where it is made on a structure set.
  std::string approval;           ///< "APPROVED", "UNAPPROVED", "REJECTED", or empty.
  std::string structure_set_uid;  ///< The instance that it refers to; empty: none.
  std::vector<PatientSetup> setups;
  std::vector<PlannedBeam> beams;
};

}  // namespace plumb
