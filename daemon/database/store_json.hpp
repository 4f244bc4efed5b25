// SPDX-License-Identifier: Apache-2.0
// Storage format of plans, settings and result summaries.
#pragma once

#include <string>

#include "web/model/couch.hpp"
#include "web/model/reference.hpp"
#include "web/model/scan.hpp"
#include "web/model/settings.hpp"

namespace plumb {

[[nodiscard]] std::string PlanJson(const ReferencePlan& plan);
/// Values that decide about a patient are never guessed: all must be present and valid.
/// @throws DataError stating what is wrong.
[[nodiscard]] ReferencePlan ParsePlan(const std::string& text);

[[nodiscard]] std::string SettingsJson(const Settings& settings);
/// For the log: {"NAME": [before, after]} for every setting that differs; [after] alone for a
/// setting that `stored` does not contain.
/// @param stored  As written by SettingsJson(), or anything else.
[[nodiscard]] std::string SettingsChanges(const std::string& stored, const Settings& settings);
/// Settings that an older Plumb did not know may be missing and get their default; nothing else
/// may.
/// @throws DataError stating what is wrong.
[[nodiscard]] Settings ParseSettings(const std::string& text);

[[nodiscard]] std::string CouchJson(const CouchProfile& couch);
/// All but "wraps" must be present, and all valid. @throws DataError stating what is wrong.
[[nodiscard]] CouchProfile ParseCouch(const std::string& text);

/// The list entry of a result.json. @throws DataError as ParseResult()
[[nodiscard]] ResultSummary SummaryOf(const std::string& result_json);

}  // namespace plumb
