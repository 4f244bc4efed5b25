// Plans, settings and result summaries as the store's JSON.
#pragma once

#include <string>

#include "web/service/service_types.hpp"

namespace plumb {

[[nodiscard]] std::string PlanJson(const web::ReferencePlan& plan);
/// What decides about a patient is never guessed: all must be there and make sense.
/// @throws DataError saying what is wrong with it.
[[nodiscard]] web::ReferencePlan ParsePlan(const std::string& text);

[[nodiscard]] std::string SettingsJson(const web::Settings& settings);
/// For the log: {"NAME": [before, after]} of every setting that differs; a setting that `stored`
/// does not hold is [after] alone.
/// @param stored  As SettingsJson() wrote it, or anything else.
[[nodiscard]] std::string SettingsChanges(const std::string& stored, const web::Settings& settings);
/// What an older Plumb did not know may be missing and has its default; nothing else.
/// @throws DataError saying what is wrong with it.
[[nodiscard]] web::Settings ParseSettings(const std::string& text);

/// The list entry of a result.json. Numbers that are missing are never taken for zero.
/// @throws DataError saying what is wrong with it.
[[nodiscard]] web::ResultSummary SummaryOf(const std::string& result_json);

}  // namespace plumb
