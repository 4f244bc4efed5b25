// The texts of the reports in each language.
#pragma once

#include <array>
#include <string>
#include <string_view>

#include "daemon/appliance/report_pictures.hpp"
#include "web/service/result_terms.hpp"
#include "web/service/scan_service.hpp"

namespace plumb {

/// The texts of one language. Texts with {} are fmt patterns.
struct ReportWords {
  web::ResultTerms terms;
  std::string_view page, scan_title, course_title;
  std::string_view patient, unassigned, site, fraction, scan, scans, reference, version, plan,
      region, corners, whole_body, isocentre, middle, planned_by, approved_by, not_approved,
      checksum, session_by, accepted, accepted_by, accepted_outside, accepted_unsure, no, printed;
  std::string_view room_markers, couch_markers, tolerance, tolerance_fact;
  std::array<std::string_view, 4> postures;    ///< HFS, HFP, FFS, FFP.
  std::array<std::string_view, 6> short_axes;  ///< With units, as column heads.
  std::string_view verdict_reference, verdict_none, verdict_in, verdict_unsure, verdict_move;
  std::string_view why_in, why_unsure, why_move;
  std::string_view quality, markers, misfit, covered, hole, tracked, tracked_of, lost, keyframes,
      longest_lost, sensor, sensor_on, room_version, computed_with;
  std::string_view frames_lost, warming, overdue_mark, overdue_words, failed_mark, failed_words,
      room_unknown, room_not_used, marker_ignored, weak_direction;
  std::string_view when, verdict, digits_note, planned_sides;
  SideWords sides;
  PictureWords pictures;
};

[[nodiscard]] const ReportWords& WordsOf(web::Language language);

/// A direction, part of the body or reason of the appliance in that language; unchanged if there is
/// no translation.
[[nodiscard]] std::string Translated(const std::string& text, web::Language language);

}  // namespace plumb
