// The words of the result page without script, in each language.
#pragma once

#include <array>
#include <string_view>

#include "web/service/result_terms.hpp"
#include "web/service/scan_service.hpp"

namespace plumb::web {

/// The texts of one verdict: while it can be acted on, and later.
struct VerdictWords {
  std::string_view now, then;
};

/// The texts of one language. With {}: patterns of fmt.
struct ResultWords {
  ResultTerms terms;
  std::string_view code;               ///< "en", for the document and for links.
  std::string_view other, other_code;  ///< The way to the other language.
  std::string_view title, notice_label;
  std::string_view log_in, name, password, wrong_password, first_password;
  std::string_view out_of_order, nobody_can;
  std::string_view none, patient, no_patient, scan_line, fraction, ago_min, ago_unknown, old;
  std::string_view running, newer_failed, accepted_by, accepted_outside, accepted_unsure;
  std::string_view reference_line, no_reference;
  VerdictWords in_tolerance, unsure, move;
  std::array<std::string_view, 6> heads;  ///< Heads of the table of the numbers.
  std::string_view no_change;
  std::string_view to_apply, found_then, remaining, remained_then, measured, measured_then;
  std::string_view where, now;
  std::string_view map, overlay;
};

[[nodiscard]] const ResultWords& ResultWordsOf(Language language);

/// The better of both for a browser's Accept-Language header; English where it names neither.
[[nodiscard]] Language PreferredLanguage(std::string_view accept_language);

}  // namespace plumb::web
