// The page's service for the calibration of the room.
#pragma once

#include "daemon/appliance/store_access.hpp"
#include "web/service/room_calibration_service.hpp"

namespace plumb {

/// Its arguments are borrowed.
class WebRoomCalibration : public web::RoomCalibrationService {
 public:
  WebRoomCalibration(Appliance& appliance, StoreAccess& store)
      : appliance_(appliance), store_(store) {}

  [[nodiscard]] web::RoomCalibrationStatus GetRoomCalibration() override;
  void SignRoomCalibration(const web::Actor& actor, const std::string& digest,
                           web::Done done) override;
  [[nodiscard]] std::optional<std::string> RoomBoardPdf(std::string& why_not) override;

 private:
  Appliance& appliance_;
  StoreAccess& store_;
};

}  // namespace plumb
