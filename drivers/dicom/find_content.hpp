// SPDX-License-Identifier: Apache-2.0
// What plumb-dicom-finder is asked for, and what it answers.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/dicom/send_content.hpp"

namespace plumb {

/// Steps of a modality worklist that are scheduled for one day.
struct WorklistRequest {
  DicomPeer peer = {};
  std::string own_ae_title = "PLUMB";
  std::string station_ae_title = {};  ///< Whose steps; empty: those of all stations.
  std::string date = {};              ///< YYYYMMDD
  DicomTlsFiles tls = {};
};

struct WorklistStep {
  std::string patient_id = {};  ///< Only to be compared (PatientHash()), never to be kept or shown.
  std::string time = {};        ///< HHMM, or empty.
};

/// Steps at most; the other side is told to stop then.
inline constexpr std::size_t kMostWorklistSteps = 500;

/// One line of JSON each. @throws DataError for what is no such text.
[[nodiscard]] std::string WorklistRequestText(const WorklistRequest& request);
[[nodiscard]] WorklistRequest ParseWorklistRequest(std::string_view text);
[[nodiscard]] std::string WorklistText(const std::vector<WorklistStep>& steps);
[[nodiscard]] std::vector<WorklistStep> ParseWorklist(std::string_view text);

}  // namespace plumb
