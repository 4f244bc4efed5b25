// Patients and their courses. Codes are pseudonyms; no field holds the name of a person who was
// scanned.
#pragma once

#include <cstdint>
#include <string>

#include "web/model/reference.hpp"
#include "web/model/scan.hpp"
#include "web/model/wall_clock.hpp"

namespace plumb {

struct Patient {
  std::string id;    ///< Id in the store, never shown.
  std::string code;  ///< The pseudonym that people type and read.
  std::string site;  ///< Region of the body: "thorax".
  WallClock::time_point created_at;
  std::string approved_reference_id;  ///< The reference for fractions; empty if there is none yet.
  std::int64_t num_scans = 0;
  /// The newest draft after the approved one; empty if there is none.
  std::string draft_reference_id;
  std::string note = {};  ///< Note on this course, at most kMaxNote bytes; no name.
  bool archived = false;  ///< Not in the list and not to be opened; nothing is deleted.
};

/// People write these about a patient's course.
struct CourseNotes {
  std::string site, note;
  bool operator==(const CourseNotes&) const = default;
};

/// A patient on the couch, from opening to closing. At most one at a time.
struct TreatmentSession {
  std::string id;
  std::string patient_id;
  std::string patient_code;
  ScanPurpose purpose = ScanPurpose::kFraction;
  int fraction = 0;   ///< 1, 2, ... in sessions for fractions, otherwise 0.
  int num_scans = 0;  ///< Completed in this session.
  std::string opened_by;
  WallClock::time_point opened_at;
};

/// Defaults for plans of one site. Letter case of site names is ignored.
struct PlanTemplate {
  std::string site;
  double width_mm = 300.0;   ///< Size of the region along x of the reference marker.
  double height_mm = 400.0;  ///< Along y.
  Tolerance tolerance;
  std::string changed_by;
};

}  // namespace plumb
