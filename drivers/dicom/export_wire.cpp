// SPDX-License-Identifier: Apache-2.0
#include "drivers/dicom/export_wire.hpp"

#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "words/dicom.hpp"

namespace plumb {
namespace {

using ExportJson = nlohmann::ordered_json;

/// Calls for each text with its key.
void ForEachText(auto& object, const auto& visit) {
  visit("patient_id", object.patient_id);
  visit("patient_name", object.patient_name);
  visit("study", object.study_uid);
  visit("series", object.series_uid);
  visit("instance", object.instance_uid);
  visit("date", object.date);
  visit("time", object.time);
  visit("title", object.title);
  visit("version", object.version);
  visit("frame", object.frame_uid);
  visit("moving_frame", object.moving_frame_uid);
}

}  // namespace

std::string ExportFactsOf(const DicomExport& object) {
  ExportJson json = {{"kind", Name(object.kind)},
                     {"series_number", object.series_number},
                     {"instance_number", object.instance_number},
                     {"width", object.width},
                     {"height", object.height}};
  ForEachText(object, [&](const char* key, const std::string& text) { json[key] = text; });
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column)
      json["matrix"].push_back(object.T_frame_moving_mm(row, column));
  return json.dump(-1, ' ', false, ExportJson::error_handler_t::replace);
}

DicomExport ParseExportFacts(std::string_view facts) {
  try {
    const auto json = ParseBoundedJson<ExportJson>(facts);
    DicomExport object;
    const auto kind = Named<DicomExportKind>(json.at("kind").get<std::string>());
    if (!kind) throw DataError(say::dicom::ReaderVersion());
    object.kind = *kind;
    object.series_number = json.at("series_number").get<std::int64_t>();
    object.instance_number = json.at("instance_number").get<std::int64_t>();
    object.width = json.at("width").get<int>();
    object.height = json.at("height").get<int>();
    ForEachText(object, [&](const char* key, std::string& text) {
      text = json.at(key).get<std::string>();
    });
    for (int i = 0; i < 16; ++i)
      object.T_frame_moving_mm(i / 4, i % 4) =
          json.at("matrix").at(static_cast<std::size_t>(i)).get<double>();
    return object;
  } catch (const nlohmann::json::exception&) {
    throw DataError(say::dicom::ReaderVersion());
  }
}

}  // namespace plumb
