// The room's calibration: its state, and the board to print.
#include "web/api/api.hpp"
#include "web/api/json.hpp"
#include "web/http/gate.hpp"

namespace plumb::web {
namespace {

constexpr const char* kPath = "/api/v1/room-calibration";
constexpr const char* kBoardPath = "/api/v1/room-calibration/board.pdf";

Json ScanJson(const RoomBoardScan& scan) {
  Json json = {{"check", scan.check_id},
               {"time", TimeText(scan.time)},
               {"user", scan.user},
               {"fault", scan.fault}};
  if (!scan.fault.empty()) return json;
  json["num_markers"] = scan.num_markers;
  json["rms_mm"] = scan.rms_mm;
  json["scale_percent"] = scan.scale_percent;
  json["shift_uncertainty_mm"] = scan.shift_uncertainty_mm;
  json["turn_uncertainty_deg"] = scan.turn_uncertainty_deg;
  return json;
}

Json VersionJson(const RoomCalibrationVersion& one) {
  return {{"version", one.version},     {"signed_at", TimeText(one.signed_at)},
          {"signed_by", one.signed_by}, {"digest", one.digest},
          {"shift_mm", one.shift_mm},   {"turn_deg", one.turn_deg},
          {"checks", one.check_ids}};
}

Json OrNull(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

Json StatusJson(const RoomCalibrationStatus& status) {
  Json json = {{"versions", Json::array()},
               {"due", status.due},
               {"configured", status.is_configured},
               {"scans", Json::array()},
               {"num_wanted", status.num_wanted},
               {"shift_mm", OrNull(status.shift_mm)},
               {"turn_deg", OrNull(status.turn_deg)},
               {"max_shift_mm", status.max_shift_mm},
               {"max_turn_deg", status.max_turn_deg},
               {"why_not_sign", status.why_not_sign},
               {"digest", status.digest}};
  for (const RoomCalibrationVersion& one : status.versions)
    json["versions"].push_back(VersionJson(one));
  for (const RoomBoardScan& scan : status.scans) json["scans"].push_back(ScanJson(scan));
  return json;
}

Response StatusResponse(RoomCalibrationService& service) {
  Response response;
  response.body = Dump(StatusJson(service.GetRoomCalibration()));
  return response;
}

Response BoardResponse(RoomCalibrationService& service) {
  std::string why_not;
  auto pdf = service.RoomBoardPdf(why_not);
  if (!pdf) return ErrorResponse(409, why_not);
  Response response;
  response.type = "application/pdf";
  response.body = std::move(*pdf);
  response.headers.emplace_back("Content-Disposition",
                                "attachment; filename=\"plumb_room_board.pdf\"");
  return response;
}

void Add(Router& router, const Services& services, const char* path,
         Response (*make)(RoomCalibrationService&)) {
  router.Add({"GET", path, Permission::kView, BodyKind::kNone,
              [&background = services.background, &room = services.room,
               name = std::string("GET ") + path, make](const Request&, const Respond& respond) {
                RespondInBackground(
                    background, name, [&room, make] { return make(room); }, respond);
              }});
}

}  // namespace

void AddRoomCalibrationRoutes(Router& router, const Services& services) {
  Add(router, services, kPath, &StatusResponse);
  Add(router, services, kBoardPath, &BoardResponse);
}

}  // namespace plumb::web
