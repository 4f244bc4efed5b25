// SPDX-License-Identifier: Apache-2.0
#include "drivers/dicom/find_content.hpp"

#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "words/dicom.hpp"

namespace plumb {
namespace {

std::string Line(const nlohmann::ordered_json& json) {
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace

std::string WorklistRequestText(const WorklistRequest& request) {
  return Line({{"called", request.peer.ae_title},
               {"host", request.peer.host},
               {"port", request.peer.port},
               {"calling", request.own_ae_title},
               {"station", request.station_ae_title},
               {"date", request.date},
               {"certificate", request.tls.certificate},
               {"key", request.tls.key},
               {"trusted", request.tls.trusted}});
}

WorklistRequest ParseWorklistRequest(std::string_view text) {
  try {
    const auto json = ParseBoundedJson<nlohmann::ordered_json>(text);
    const auto word = [&](const char* key) { return json.at(key).get<std::string>(); };
    return {
        .peer = {.ae_title = word("called"),
                 .host = word("host"),
                 .port = json.at("port").get<std::uint16_t>()},
        .own_ae_title = word("calling"),
        .station_ae_title = word("station"),
        .date = word("date"),
        .tls = {
            .certificate = word("certificate"), .key = word("key"), .trusted = word("trusted")}};
  } catch (const nlohmann::json::exception&) {
    throw DataError(say::dicom::ReaderVersion());
  }
}

std::string WorklistText(const std::vector<WorklistStep>& steps) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const WorklistStep& step : steps)
    json.push_back({{"patient_id", step.patient_id}, {"time", step.time}});
  return Line(json);
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
