// SPDX-License-Identifier: Apache-2.0
// Patients and their courses. Codes are pseudonyms; no field holds the name of a person who was
// scanned.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "web/model/plain_code.hpp"
#include "web/model/reference.hpp"
#include "web/model/scan.hpp"
#include "web/model/wall_clock.hpp"

namespace plumb {

/// Whether the last letter or digit of a code is the check character of those before it, by ISO/IEC
/// 7064, MOD 37,36: one wrong character is always found, and so are nearly all that changed places.
[[nodiscard]] inline bool HasCheckCharacter(std::string_view code) {
  constexpr int kNone = -1, kLetters = 36;
  int sum = kLetters, last = kNone, count = 0;
  for (const char c : PlainCode(code)) {
    const int value = c >= '0' && c <= '9' ? c - '0' : c >= 'A' && c <= 'Z' ? c - 'A' + 10 : kNone;
    if (value == kNone) continue;
    if (last != kNone) {
      const int rest = (sum + last) % kLetters;
      sum = (rest == 0 ? kLetters : rest) * 2 % (kLetters + 1);
    }
    last = value;
    ++count;
  }
  return count > 1 && (sum + last) % kLetters == 1;
}

/// For how long a closed session can go on.
inline constexpr int kResumable_h = 12;

/// A session for fractions that is closed and can be opened again.
struct EndedSession {
  std::string id;
  int fraction = 0;
  int num_scans = 0;  ///< Completed in it.
  WallClock::time_point closed_at;
};

struct Patient {
  std::string id;    ///< Id in the store, never shown.
  std::string code;  ///< The pseudonym that people type and read.
  std::string site;  ///< Region of the body: "thorax".
  WallClock::time_point created_at;
  std::string approved_reference_id;  ///< The reference for fractions; empty if there is none yet.
  std::int64_t num_scans = 0;
  /// The newest draft after the approved one; empty if there is none.
  std::string draft_reference_id;
  std::string note = {};            ///< Note on this course, at most kMaxNote bytes; no name.
  std::string immobilisation = {};  ///< The set-up sheet: devices and how they are set.
  std::string alert = {};           ///< What has to be known before the patient is set up.
  bool has_photo = false;           ///< PatientService::Photo() has one.
  bool has_drawing = false;         ///< PatientService::Drawing() has one.
  int sheet_revision = 0;           ///< Grows with every photo and every drawing.
  bool archived = false;            ///< Not in the list and not to be opened; nothing is deleted.
  /// The newest session for fractions in which a sweep was begun, if it was closed in the last
  /// kResumable_h hours. Not set in lists.
  std::optional<EndedSession> last_session = {};
};

/// A point of what people draw on the set-up sheet: over the photo, or over the outline of a body
/// where there is none.
struct DrawnPoint {
  double x = 0.0, y = 0.0;  ///< Fractions of the picture's width and height, from its top left.
  bool begins = true;       ///< A line; one without more points is a mark.
  bool operator==(const DrawnPoint&) const = default;
};

/// People write these about a patient's course.
struct CourseNotes {
  std::string site, note;
  std::optional<std::string> immobilisation = {}, alert = {};  ///< Not set: they stay.
  bool operator==(const CourseNotes&) const = default;
};

/// A version of a reference by its number.
struct ReferenceVersion {
  std::string id;
  int version = 0;
  ReferenceSource source = ReferenceSource::kSweep;
  bool operator==(const ReferenceVersion&) const = default;
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
  bool has_unaccepted = false;  ///< Nobody has accepted its newest result.
  /// What its scans are compared with. Not set while no reference is approved.
  std::optional<ReferenceVersion> reference = {};
  std::optional<WallClock::time_point> reference_created_at = {};
  /// A newer one that was approved since, also since a person chose `reference`: used once a person
  /// says so.
  std::optional<ReferenceVersion> newer_reference = {};
  /// The newest approved one of the other source: the planning CT where a captured surface is
  /// compared with, or the other way round. A person may choose it for this session.
  std::optional<ReferenceVersion> other_reference = {};
  std::string language = {};    ///< The choice of the person who opened it; empty: none.
  std::string sweep_hint = {};  ///< Of the template of the patient's site; empty: none.
};

/// Defaults for plans of one site. Letter case of site names is ignored.
struct PlanTemplate {
  std::string site;
  double width_mm = 300.0;   ///< Size of the region along x of the reference marker.
  double height_mm = 400.0;  ///< Along y.
  Tolerance tolerance;
  std::string changed_by;
  std::string posture = {};  ///< Empty: as the plan has it.
  std::string hint = {};     ///< To whoever sweeps, shown before the sweep; empty: none.
};

}  // namespace plumb
