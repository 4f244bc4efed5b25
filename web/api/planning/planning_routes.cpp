// SPDX-License-Identifier: Apache-2.0
// The planning CT: its upload, what was received from the planning system, and today's worklist.
#include "web/api/all_routes.hpp"

#include <string>

#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "algo/base/parse_number.hpp"
#include "web/exchange/json.hpp"
#include "web/exchange/routes.hpp"
#include "web/http/checks.hpp"
#include "web/model/limits.hpp"
#include "words/scan.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

constexpr std::size_t kMaxFileName = 64;

/// What is said of the files stands in a header, as a form: names of contours are free texts, which
/// the address does not take.
SentPlanning ParsePlanning(const Request& request) {
  const auto form = ParseForm(request.Header("x-plumb-planning"));
  if (!form) throw DataError(say::web::Malformed());
  const auto text = [&](const char* name, std::size_t most) {
    const auto found = form->find(name);
    const std::string value = found == form->end() ? std::string() : found->second;
    if (value.size() > most)
      throw DataError(say::web::FieldLength(name, 0, static_cast<std::int64_t>(most),
                                            static_cast<std::int64_t>(value.size())));
    return value;
  };
  const auto bytes = [&](const char* name) {
    const auto number = ParseNumber<std::uint64_t>(text(name, 20));
    if (!number || *number > kMaxPlanningFile)
      throw DataError(say::web::FieldWholeRange(name, static_cast<std::int64_t>(kMaxPlanningFile)));
    return *number;
  };
  SentPlanning sent{.file = request.upload->path(),
                    .structures_bytes = bytes("structures_bytes"),
                    .plan_bytes = 0,
                    .threshold_hu = {},
                    .images = {},
                    .roi = text("roi", kMaxPlanningName),
                    .beam = text("isocentre_of", kMaxPlanningName),
                    .reason = text("reason", kMaxReason),
                    .is_same_patient = text("same_patient", 3) == "yes"};
  // Images are there exactly where their threshold is stated.
  if (const std::string threshold = text("threshold_hu", 20); !threshold.empty()) {
    sent.threshold_hu = ParseNumber<double>(threshold);
    if (!sent.threshold_hu) throw DataError(say::web::FieldNumber("threshold_hu", threshold));
    if (!(*sent.threshold_hu >= kMinSkinThreshold_hu && *sent.threshold_hu <= kMaxSkinThreshold_hu))
      throw DataError(say::web::FieldRange("threshold_hu", kMinSkinThreshold_hu,
                                           kMaxSkinThreshold_hu, *sent.threshold_hu));
    sent.plan_bytes = bytes("plan_bytes");
    if (sent.plan_bytes == 0) throw DataError(say::scan::PlanningTwoFiles());
  } else if (sent.structures_bytes == 0) {
    throw DataError(say::scan::PlanningTwoFiles());
  }
  return sent;
}

void AddUploadRoute(Routes& routes, ReferenceService& references) {
  Route& route =
      routes.Write("POST", "/api/v1/patients/{id}/planning", Permission::kPlan, BodyKind::kFile,
                   [&references](const Request& request, const Done& done) {
                     references.AddPlanning(request.actor(), request.arguments[0],
                                            ParsePlanning(request), KeepingUpload(request, done));
                   });
  route.most_bytes = 2 * kMaxPlanningFile + kMaxPlanningImages;
}

Json FileJson(const ReceivedFile& file) {
  Json json = {{"name", file.name},
               {"kind", Name(file.kind)},
               {"received_at", file.received_at},
               {"sender", file.sender},
               {"address", file.address},
               {"bytes", file.bytes},
               {"label", file.label},
               {"structures", file.structures},
               {"series", file.series},
               {"has_skin", file.has_skin},
               {"patient_id", file.patient_id},
               {"patient_code", file.patient_code},
               {"reference_id", file.reference_id},
               {"is_read", file.is_read}};
  PutMessage(json, "fault", file.fault);
  return json;
}

Json SeriesJson(const ReceivedSeries& series) {
  return {{"uid", series.uid},
          {"received_at", series.received_at},
          {"sender", series.sender},
          {"address", series.address},
          {"images", series.images},
          {"patient_id", series.patient_id},
          {"patient_code", series.patient_code}};
}

Json ReceivedJson(const Received& received) {
  Json json = {{"is_on", received.is_on},   {"is_settled", received.is_settled},
               {"files", Json::array()},    {"series", Json::array()},
               {"images", received.images}, {"unlisted", received.unlisted},
               {"unread", received.unread}, {"damaged_images", received.damaged_images}};
  for (const ReceivedFile& file : received.files) json["files"].push_back(FileJson(file));
  for (const ReceivedSeries& one : received.series) json["series"].push_back(SeriesJson(one));
  PutMessage(json, "image_fault", received.image_fault);
  PutMessage(json, "fault", received.fault);
  return json;
}

ReceivedChoice ParseChoice(const Request& request) {
  Fields fields(request.body);
  const auto said = [&](const char* name, std::size_t most) {
    return fields.Has(name) ? fields.Text(name, 0, most) : std::string();
  };
  ReceivedChoice choice{
      .structures = said("structures", kMaxFileName),
      .plan = fields.Text("plan", 1, kMaxFileName),
      .series = said("series", kMaxFileName),
      .roi = said("roi", kMaxPlanningName),
      .beam = said("isocentre_of", kMaxPlanningName),
      .reason = said("reason", kMaxReason),
      .is_same_patient = fields.Has("same_patient") && fields.Flag("same_patient")};
  if (!choice.series.empty())
    choice.threshold_hu = fields.Number("threshold_hu", kMinSkinThreshold_hu, kMaxSkinThreshold_hu);
  fields.Finish();
  if (choice.series.empty() && choice.structures.empty())
    throw DataError(say::scan::PlanningTwoFiles());
  return choice;
}

void AddReceivedRoutes(Routes& routes, PlanningService& planning) {
  routes
      .Read("/api/v1/planning/received", Permission::kPlan,
            [&planning](const Request&) {
              return JsonResponse(ReceivedJson(planning.GetReceived()));
            })
      .Discloses("view.patients");
  routes.Write("POST", "/api/v1/patients/{id}/planning/received", Permission::kPlan,
               BodyKind::kJson, [&planning](const Request& request, const Done& done) {
                 planning.ImportReceived(request.actor(), request.arguments[0],
                                         ParseChoice(request), done);
               });
}

void AddWorklistRoute(Routes& routes, PlanningService& planning) {
  routes
      .Read("/api/v1/worklist", Permission::kView,
            [&planning](const Request&) {
              const TodaysWorklist list = planning.GetWorklist();
              Json json = {{"is_on", list.is_on},
                           {"is_settled", list.is_settled},
                           {"patients", Json::array()},
                           {"unknown", list.unknown}};
              for (const Appointment& one : list.patients)
                json["patients"].push_back({{"time", one.time},
                                            {"patient_id", one.patient_id},
                                            {"patient_code", one.patient_code}});
              PutMessage(json, "fault", list.fault);
              return JsonResponse(json);
            })
      .Discloses("view.patients");
}

}  // namespace

void AddPlanningApi(Routes& routes, const Services& services) {
  AddUploadRoute(routes, services.references);
  AddReceivedRoutes(routes, services.planning);
  AddWorklistRoute(routes, services.planning);
}

}  // namespace plumb::web
