// SPDX-License-Identifier: Apache-2.0
// Of the sensor in use: its profile and the judgement of repeated sweeps.
#include <charconv>
#include <utility>

#include <fmt/format.h>

#include "algo/base/bounded_json.hpp"
#include "web/api/all_routes.hpp"
#include "web/exchange/json.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

Json ProfilesJson(const SensorProfiles& profiles) {
  Json json = {{"serial", profiles.serial}, {"versions", Json::array()}};
  PutMessage(json, "why_none", profiles.why_none, "");
  for (const SensorProfileVersion& one : profiles.versions)
    json["versions"].push_back({{"version", one.version},
                                {"made_at", one.made_at},
                                {"cause", Name(one.cause)},
                                {"num_sweeps", one.num_sweeps},
                                {"values", one.values}});
  return json;
}

int VersionIn(const std::string& text) {
  int version = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), version);
  return error == std::errc() && end == text.data() + text.size() ? version : 0;
}

Json RepeatsJson(const SensorRepeats& repeats) {
  Json json = {
      {"serial", repeats.serial},
      {"due", repeats.is_due},
      {"wanted", kRepeatsWanted},
      {"sweeps", Json::array()},
      {"judged", repeats.judged.empty() ? Json() : ParseBoundedJson<Json>(repeats.judged)}};
  PutMessage(json, "why_none", repeats.why_none, "");
  for (const SensorRepeats::Sweep& sweep : repeats.sweeps)
    json["sweeps"].push_back({{"scan_id", sweep.scan_id}, {"time", sweep.time}});
  return json;
}

}  // namespace

void AddSensorRoutes(Routes& routes, const Services& services) {
  SensorProfileService& profiles = services.profiles;
  routes.ReadInBackground("/api/v1/sensor-repeats", Permission::kView, [&profiles](const Request&) {
    return JsonResponse(RepeatsJson(profiles.GetSensorRepeats()));
  });
  routes.Write("POST", "/api/v1/sensor-repeats", Permission::kScan, BodyKind::kJson,
               [&profiles](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const std::string serial = fields.Text("serial", 1, 256);
                 fields.Finish();
                 profiles.JudgeSensorRepeats(request.actor(), serial, done);
               });
  routes.ReadInBackground("/api/v1/sensor-profile", Permission::kView, [&profiles](const Request&) {
    return JsonResponse(ProfilesJson(profiles.GetSensorProfiles()));
  });
  routes.ReadInBackground("/api/v1/sensor-profile/{version}/file", Permission::kView,
                          [&profiles](const Request& request) {
                            auto text = profiles.SensorProfileFile(VersionIn(request.arguments[0]));
                            if (!text) return ErrorResponse(404, say::web::NoSuchProfile());
                            return Download(
                                "application/json", std::move(*text),
                                fmt::format("plumb_sensor_profile_{}.json", request.arguments[0]));
                          });
}

}  // namespace plumb::web
