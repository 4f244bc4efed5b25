// SPDX-License-Identifier: Apache-2.0
#include "drivers/dicom/find_content.hpp"

#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "drivers/dicom/call_wire.hpp"
#include "words/dicom.hpp"

namespace plumb {
std::string WorklistRequestText(const WorklistRequest& request) {
  nlohmann::ordered_json json = CallToJson(request);
  json["station"] = request.station_ae_title;
  json["date"] = request.date;
  return LineOf(json);
}

WorklistRequest ParseWorklistRequest(std::string_view text) {
  try {
    const auto json = ParseBoundedJson<nlohmann::ordered_json>(text);
    auto request = CallFromJson<WorklistRequest>(json);
    request.station_ae_title = json.at("station").get<std::string>();
    request.date = json.at("date").get<std::string>();
    return request;
  } catch (const nlohmann::json::exception&) {
    throw DataError(say::dicom::ReaderVersion());
  }
}

std::string WorklistText(const std::vector<WorklistStep>& steps) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const WorklistStep& step : steps)
    json.push_back({{"patient_id", step.patient_id}, {"time", step.time}});
  return LineOf(json);
}

std::vector<WorklistStep> ParseWorklist(std::string_view text) {
  try {
    const auto json = ParseBoundedJson<nlohmann::ordered_json>(text);
    if (!json.is_array()) throw DataError(say::dicom::ReaderVersion());
    std::vector<WorklistStep> steps;
    for (const auto& one : json)
      steps.push_back({.patient_id = one.at("patient_id").get<std::string>(),
                       .time = one.at("time").get<std::string>()});
    return steps;
  } catch (const nlohmann::json::exception&) {
    throw DataError(say::dicom::ReaderVersion());
  }
}

}  // namespace plumb
