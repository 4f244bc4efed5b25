#include "daemon/appliance/web_room.hpp"

#include <utility>

#include <fmt/format.h>

#include "daemon/loop/log.hpp"

namespace plumb {

web::RoomCalibrationStatus WebRoomCalibration::GetRoomCalibration() {
  web::RoomCalibrationStatus status;
  if (appliance_.store() == nullptr) return status;
  try {
    status = appliance_.RoomCalibration();
  } catch (const std::exception& error) {
    Log(LogLevel::kError,
        fmt::format("the room's calibration cannot be read from the store: {}", error.what()));
    status.due = status.why_not_sign = error.what();
  }
  return status;
}

void WebRoomCalibration::SignRoomCalibration(const web::Actor& actor, const std::string& digest,
                                             web::Done done) {
  const auto [serial, since] = appliance_.RoomScansWanted();
  // StoreAccess calls nothing once the services are destroyed, and the appliance outlives them.
  store_.Change(
      &Store::room,
      [&appliance = appliance_, done = std::move(done)](const web::Change& answer) {
        if (answer.result == web::ChangeResult::kDone) appliance.RefreshRoom();
        done(answer);
      },
      [=, serial = serial, since = since](RoomStore& room) {
        return room.Sign(actor, serial, since, digest);
      });
}

std::optional<std::string> WebRoomCalibration::RoomBoardPdf(std::string& why_not) {
  try {
    return appliance_.RoomBoardPdf();
  } catch (const std::exception& error) {
    why_not = error.what();
    return std::nullopt;
  }
}

}  // namespace plumb
