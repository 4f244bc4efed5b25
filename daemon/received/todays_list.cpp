// SPDX-License-Identifier: Apache-2.0
#include "daemon/received/todays_list.hpp"

#include <algorithm>
#include <tuple>

#include "daemon/planning/patient_hash.hpp"

namespace plumb {
namespace {

/// "0930" as "09:30"; empty for what is no time.
std::string TimeOfDay(const std::string& time) {
  const bool is_time = time.size() >= 4 && std::all_of(time.begin(), time.begin() + 4,
                                                       [](char c) { return c >= '0' && c <= '9'; });
  return is_time ? time.substr(0, 2) + ":" + time.substr(2, 2) : std::string();
}

}  // namespace

TodaysWorklist ListToday(const std::vector<WorklistStep>& steps, std::string_view key,
                         const PlannedPatients& patients) {
  TodaysWorklist list{.is_on = true};
  for (const WorklistStep& step : steps) {
    const std::string hash = PatientHash(key, step.patient_id);
    const auto found = patients.find(hash);
    if (hash.empty() || found == patients.end()) {
      ++list.unknown;
      continue;
    }
    list.patients.push_back({.time = TimeOfDay(step.time),
                             .patient_id = found->second.id,
                             .patient_code = found->second.code});
  }
  std::ranges::sort(list.patients, {},
                    [](const Appointment& one) { return std::tie(one.time, one.patient_code); });
  return list;
}

}  // namespace plumb
