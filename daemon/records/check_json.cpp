// SPDX-License-Identifier: Apache-2.0
#include "daemon/records/check_json.hpp"

#include <cmath>

#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/message_json.hpp"
#include "algo/base/parse_number.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

using Json = nlohmann::ordered_json;

std::optional<SceneMarker> MarkerIn(const Json& json) {
  SceneMarker marker;
  const Json corners = json.value("corners_m", Json());
  if (!corners.is_array() || corners.size() != marker.corners.size()) return std::nullopt;
  for (std::size_t i = 0; i < marker.corners.size(); ++i) {
    if (!corners[i].is_array() || corners[i].size() != 3) return std::nullopt;
    for (std::size_t k = 0; k < 3; ++k) {
      if (!corners[i][k].is_number()) return std::nullopt;
      marker.corners[i][static_cast<Eigen::Index>(k)] = corners[i][k].get<double>();
    }
  }
  marker.num_views = json.value("views", 0);
  marker.sigma_m = json.value("sigma_m", marker.sigma_m);
  return marker;
}

}  // namespace

Json MarkersJson(const MarkerMap& markers) {
  Json json = Json::object();
  for (const auto& [id, marker] : markers) {
    Json corners = Json::array();
    for (const Eigen::Vector3d& p : marker.corners) corners.push_back({p.x(), p.y(), p.z()});
    json[std::to_string(id)] = {
        {"corners_m", corners}, {"views", marker.num_views}, {"sigma_m", marker.sigma_m}};
  }
  return json;
}

std::optional<MarkerMap> MarkersIn(const Json& json) {
  if (!json.is_object()) return std::nullopt;
  MarkerMap markers;
  for (const auto& [name, value] : json.items()) {
    const std::optional<int> id = ParseNumber<int>(name);
    const auto marker = MarkerIn(value);
    if (!id || *id < 0 || !marker) return std::nullopt;
    markers.emplace(*id, *marker);
  }
  return markers;
}

std::string CheckJson(const TakenCheck& taken) {
  const std::vector<Message>& reasons = taken.check.reasons;
  Json json = {{"status", Name(taken.check.status)},
               {"reasons", EnglishTexts(reasons)},
               {"reason_messages", MessagesJson(reasons)},
               {"cautions", EnglishTexts(taken.check.cautions)},
               {"caution_messages", MessagesJson(taken.check.cautions)},
               {"items", Json::array()}};
  for (const MarkerCheckItem& item : taken.check.items) {
    const Message& note = item.note;
    json["items"].push_back(
        Json{{"name", item.name},
             {"value", std::isfinite(item.value) ? Json(item.value) : Json(nullptr)},
             {"limit", item.limit},
             {"unit", item.unit},
             {"passed", item.passed},
             {"note", note.English()},
             {"note_message", note.empty() ? Json(nullptr) : MessageJson(note)}});
  }
  json["dictionary"] = taken.seen.room_markers.dictionary;
  json["marker_length_m"] = taken.seen.room_markers.length_m;
  json["markers"] = MarkersJson(taken.seen.markers);
  if (!taken.board.empty()) json["board"] = MarkersJson(taken.board);
  json["reference_marker"] = taken.reference_marker ? Json(*taken.reference_marker) : Json(nullptr);
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::optional<MarkerBaseline> BaselineIn(const std::string& check_json) {
  const Json json = ParseBoundedJsonOrNothing<Json>(check_json);
  if (!json.is_object() || !json.value("markers", Json()).is_object() || json["markers"].empty())
    return std::nullopt;
  auto markers = MarkersIn(json["markers"]);
  if (!markers) return std::nullopt;
  return MarkerBaseline{std::move(*markers),
                        {.dictionary = json.value("dictionary", std::string()),
                         .length_m = json.value("marker_length_m", 0.0)}};
}

CheckRecord CheckIn(const std::string& check_json) {
  CheckRecord record;
  const Json json = ParseBoundedJsonOrNothing<Json>(check_json);
  const auto unreadable = [&record](const Message& why) {
    record = {};
    record.reasons = {say::store::CheckUnreadable(why)};
    return record;
  };
  if (!json.is_object()) return unreadable(say::store::CheckNoObject());
  try {
    const auto status = Named<MarkerCheckStatus>(json.at("status").get<std::string>());
    if (!status) return unreadable(say::store::CheckUnknownStatus());
    record.status = *status;
    record.reasons = MessagesFromJson(json.value("reason_messages", Json()),
                                      json.value("reasons", std::vector<std::string>()));
    record.cautions = MessagesFromJson(json.value("caution_messages", Json()),
                                       json.value("cautions", std::vector<std::string>()));
    record.num_markers = json.value("markers", Json::object()).size();
    for (const Json& item : json.value("items", Json::array())) {
      const Json value = item.value("value", Json());
      record.items.push_back(
          {.name = item.value("name", std::string()),
           .value = value.is_number() ? std::optional(value.get<double>()) : std::nullopt,
           .limit = item.value("limit", 0.0),
           .unit = item.value("unit", std::string()),
           .passed = item.value("passed", false),
           .note = MessageFromJson(item.value("note_message", Json()),
                                   item.value("note", std::string()))});
    }
  } catch (const Json::exception&) {
    return unreadable(say::store::CheckWrongType());
  }
  return record;
}

}  // namespace plumb
