// The page's services for the daily check, the room's calibration and the sensor's profile.
#include "daemon/appliance/web_services.hpp"

#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "daemon/loop/log.hpp"

namespace plumb {

namespace {

class WebChecks final : public web::CheckService {
 public:
  WebChecks(Appliance& appliance, StoreAccess& store) : appliance_(appliance), store_(store) {}

  CheckStatus GetChecks() override {
    return store_.Read([this](Store&) { return appliance_.references().Checks(); });
  }

  void OpenCheck(const Actor& actor, Done done) override {
    if (const std::string refusal = appliance_.OpenCheck(actor); !refusal.empty())
      return done(AnswerOf(refusal));
    store_.Write(&Store::audit, std::move(done),
                 [=](AuditStore& audit) { audit.Log(actor, "check.open", "", ""); });
  }

  void SetCheckBaseline(const Actor& actor, const std::string& check_id, Done done) override {
    store_.Write(&Store::checks, std::move(done),
                 [=](CheckStore& checks) { checks.SetBaseline(actor, check_id); });
  }

 private:
  Appliance& appliance_;
  StoreAccess& store_;
};

class WebRoomCalibration final : public web::RoomCalibrationService {
 public:
  WebRoomCalibration(Appliance& appliance, StoreAccess& store)
      : appliance_(appliance), store_(store) {}

  web::RoomCalibrationStatus GetRoomCalibration() override {
    web::RoomCalibrationStatus status;
    if (appliance_.store() == nullptr) return status;
    try {
      status = appliance_.room().Calibration();
    } catch (const std::exception& error) {
      Log(LogLevel::kError,
          fmt::format("the room's calibration cannot be read from the store: {}", error.what()));
      status.due = status.why_not_sign = error.what();
    }
    return status;
  }

  void SignRoomCalibration(const Actor& actor, const std::string& digest, Done done) override {
    const auto [serial, since] = appliance_.room().ScansWanted();
    // StoreAccess calls nothing once the services are destroyed, and the appliance outlives them.
    store_.Write(
        &Store::room,
        [&appliance = appliance_, done = std::move(done)](const Change& answer) {
          if (answer.result == ChangeResult::kDone) appliance.room().Refresh();
          done(answer);
        },
        [=, serial = serial, since = since](RoomStore& room) {
          return room.Sign(actor, serial, since, digest);
        });
  }

  std::optional<std::string> RoomBoardPdf(std::string& why_not) override {
    try {
      return appliance_.room().BoardPdf();
    } catch (const std::exception& error) {
      why_not = error.what();
      return std::nullopt;
    }
  }

 private:
  Appliance& appliance_;
  StoreAccess& store_;
};

class WebSensorProfiles final : public web::SensorProfileService {
 public:
  WebSensorProfiles(Appliance& appliance, StoreAccess& store)
      : appliance_(appliance), store_(store) {}

  SensorProfiles GetSensorProfiles() override { return appliance_.profiles().OfConnected(); }

  std::optional<std::string> SensorProfileFile(int version) override {
    return appliance_.profiles().FileOf(version);
  }

  void ResetSensorProfile(const Actor& actor, const std::string& serial, Done done) override {
    ChangeProfile(serial, done, [=, shelf = appliance_.profiles().shelf()](AuditStore& audit) {
      const int version = shelf->Reset(serial);
      audit.Log(actor, "profile.reset", serial, fmt::format("version {}", version));
    });
  }

  void RollBackSensorProfile(const Actor& actor, const std::string& serial, int version,
                             Done done) override {
    ChangeProfile(serial, done, [=, shelf = appliance_.profiles().shelf()](AuditStore& audit) {
      try {
        const int made = shelf->RollBack(serial, version);
        audit.Log(actor, "profile.roll_back", serial,
                  fmt::format("to version {}, which is version {} now", version, made));
      } catch (const DataError& error) {
        throw StoreRefusal(ChangeResult::kNotFound, error.what());
      }
    });
  }

 private:
  /// As StoreAccess::Change(); afterwards the last scan's objection to the profile is discarded.
  void ChangeProfile(const std::string& serial, const Done& done,
                     std::function<void(AuditStore&)> change) {
    if (RefuseIf(appliance_.WhyNotIdle(), done)) return;
    if (RefuseIf(appliance_.profiles().WhyNotChange(serial), done)) return;
    store_.Write(
        &Store::audit,
        [this, done](const Change& answer) {
          if (answer.result == ChangeResult::kDone) appliance_.ForgetDrift();
          done(answer);
        },
        std::move(change));
  }

  Appliance& appliance_;
  StoreAccess& store_;
};

}  // namespace

std::unique_ptr<web::CheckService> MakeWebChecks(Appliance& appliance, StoreAccess& store) {
  return std::make_unique<WebChecks>(appliance, store);
}

std::unique_ptr<web::RoomCalibrationService> MakeWebRoomCalibration(Appliance& appliance,
                                                                    StoreAccess& store) {
  return std::make_unique<WebRoomCalibration>(appliance, store);
}

std::unique_ptr<web::SensorProfileService> MakeWebSensorProfiles(Appliance& appliance,
                                                                 StoreAccess& store) {
  return std::make_unique<WebSensorProfiles>(appliance, store);
}

}  // namespace plumb
