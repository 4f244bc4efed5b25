// Plans, settings and result summaries as the store's JSON.
#pragma once

#include <string>

#include "web/service/service_types.hpp"

namespace plumb {

[[nodiscard]] std::string PlanJson(const web::ReferencePlan& plan);
/// What cannot be read keeps its default: the text is our own.
[[nodiscard]] web::ReferencePlan ParsePlan(const std::string& text);

[[nodiscard]] std::string SettingsJson(const web::Settings& settings);
[[nodiscard]] web::Settings ParseSettings(const std::string& text);

/// The list entry of a result.json. @throws DataError if it is none.
[[nodiscard]] web::ResultSummary SummaryOf(const std::string& result_json);

}  // namespace plumb
