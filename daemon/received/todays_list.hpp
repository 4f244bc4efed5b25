// SPDX-License-Identifier: Apache-2.0
// The clinic's worklist of today, with the patients whom it names that are known here.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/dicom/find_content.hpp"
#include "web/model/planning.hpp"

namespace plumb {

/// A patient whose planning files were imported.
struct PlannedPatient {
  std::string id, code;
};
/// By the keyed hash of the Patient ID in their files.
using PlannedPatients = std::map<std::string, PlannedPatient>;

/// Of the steps only the time and the patient known here remain; all others are counted.
/// @param key  For PatientHash().
[[nodiscard]] TodaysWorklist ListToday(const std::vector<WorklistStep>& steps, std::string_view key,
                                       const PlannedPatients& patients);

}  // namespace plumb
