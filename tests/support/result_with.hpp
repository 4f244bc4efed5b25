// SPDX-License-Identifier: Apache-2.0
// Whole results for tests that care about few of their values.
#pragma once

#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

#include "daemon/result/stored_result.hpp"

namespace plumb::testing {

/// The text of a result in which these values are set, and for a verdict without numbers some that
/// have it. Tolerances are 3 mm and 1 degree.
/// @param values  As in result.json; null removes a value.
inline std::string ResultWith(std::string_view values) {
  using Json = nlohmann::ordered_json;
  Json patch = Json::parse(values);
  StoredResult whole;
  whole.version = "0.3.0";
  whole.preset = "best";
  whole.limits.shift_tolerance_mm = 3;
  whole.limits.rotation_tolerance_deg = 1;
  whole.alignment.emplace();
  whole.motion.emplace().weak_directions.emplace_back();
  whole.correction.emplace();
  whole.region.emplace();
  whole.body.emplace().parts.emplace_back();
  whole.body->room_known = true;
  Json result = Json::parse(ResultText(whole));
  result["correction"].erase("judgements");
  const std::string verdict =
      patch.contains("verdict") && patch["verdict"].is_string() ? patch["verdict"] : Json("");
  if (!patch.contains("correction") && verdict != "no_answer" && !verdict.empty())
    patch["correction"] = {{"vertical_mm", verdict == "move" ? 6.5 : 2.5},
                           {"pitch_deg", 0.0},
                           {"roll_deg", 0.0},
                           {"yaw_deg", 0.0},
                           {"uncertainty",
                            {{"vertical_mm", verdict == "unsure" ? 0.9 : 0.3},
                             {"pitch_deg", 0.1},
                             {"roll_deg", 0.1},
                             {"yaw_deg", 0.1}}}};
  // Lists are replaced as a whole, so that their elements are completed here.
  const auto complete = [&](const char* part, const char* list) {
    const Json element = result[part][list][0];
    result[part][list] = Json::array();
    if (!patch.contains(part) || !patch[part].contains(list)) return;
    for (Json& one : patch[part][list]) {
      Json merged = element;
      merged.merge_patch(one);
      one = merged;
    }
  };
  complete("body", "parts");
  complete("motion", "weak_directions");
  for (const char* part : {"alignment", "motion", "correction", "region", "body"})
    if (!patch.contains(part)) result[part] = nullptr;
  result.merge_patch(patch);
  return result.dump();
}

/// What the method decides about these numbers.
inline NumberJudgements JudgementsOf(const StoredResult& result) {
  NumberJudgements judgements{};
  if (!result.correction) return judgements;
  for (std::size_t i = 0; i < judgements.size(); ++i)
    judgements[i] = JudgeNumber(result.correction->value[i], result.correction->u95[i],
                                result.limits.ToleranceOf(i));
  return judgements;
}

}  // namespace plumb::testing
