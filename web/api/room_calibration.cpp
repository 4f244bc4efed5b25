// SPDX-License-Identifier: Apache-2.0
// The room's calibration: its state, and the board to print.
#include <utility>

#include "web/api/all_routes.hpp"
#include "web/exchange/json.hpp"

namespace plumb::web {
namespace {

Json ScanJson(const RoomBoardScan& scan) {
  Json json = {{"check", scan.check_id}, {"time", scan.time}, {"user", scan.user}};
  PutMessage(json, "fault", scan.fault, "");
  if (!scan.fault.empty()) return json;
  json["num_markers"] = scan.num_markers;
  json["rms_mm"] = scan.rms_mm;
  json["scale_percent"] = scan.scale_percent;
  json["shift_uncertainty_mm"] = scan.shift_uncertainty_mm;
  json["turn_uncertainty_deg"] = scan.turn_uncertainty_deg;
  return json;
}

Json VersionJson(const RoomCalibrationVersion& one) {
  return {{"version", one.version}, {"signed_at", one.signed_at}, {"signed_by", one.signed_by},
          {"digest", one.digest},   {"shift_mm", one.shift_mm},   {"turn_deg", one.turn_deg},
          {"checks", one.check_ids}};
}

Json StatusJson(const RoomCalibrationStatus& status) {
  Json json = {{"versions", Json::array()},
               {"configured", status.is_configured},
               {"scans", Json::array()},
               {"num_wanted", status.num_wanted},
               {"shift_mm", status.shift_mm},
               {"turn_deg", status.turn_deg},
               {"max_shift_mm", status.max_shift_mm},
               {"max_turn_deg", status.max_turn_deg},
               {"digest", status.digest}};
  PutMessage(json, "due", status.due, "");
  PutMessage(json, "why_not_sign", status.why_not_sign, "");
  for (const RoomCalibrationVersion& one : status.versions)
    json["versions"].push_back(VersionJson(one));
  for (const RoomBoardScan& scan : status.scans) json["scans"].push_back(ScanJson(scan));
  return json;
}

}  // namespace

void AddRoomCalibrationRoutes(Routes& routes, const Services& services) {
  RoomCalibrationService& room = services.room;
  routes.ReadInBackground("/api/v1/room-calibration", Permission::kView, [&room](const Request&) {
    return JsonResponse(StatusJson(room.GetRoomCalibration()));
  });
  routes.ReadInBackground(
      "/api/v1/room-calibration/board.pdf", Permission::kView, [&room](const Request&) {
        Message why_not;
        auto pdf = room.RoomBoardPdf(why_not);
        if (!pdf) return ErrorResponse(409, why_not);
        return Download("application/pdf", std::move(*pdf), "plumb_room_board.pdf");
      });
}

}  // namespace plumb::web
