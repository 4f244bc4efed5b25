// SPDX-License-Identifier: Apache-2.0
// The page's services for the daily check, the room's calibration and the sensor's profile.
#include "daemon/services/web_services.hpp"

#include <memory>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/services/sensor_repeats.hpp"
#include "words/audit.hpp"
#include "words/store.hpp"

namespace plumb {

namespace {

class WebChecks final : public web::CheckService {
 public:
  WebChecks(Appliance& appliance, const ReferenceGate& references, StoreAccess& store)
      : appliance_(appliance), references_(references), store_(store) {}

  CheckStatus GetChecks() override {
    return store_.Read([this](Store&) { return references_.Checks(); });
  }

  void OpenCheck(const Actor& actor, Done done) override {
    if (const Message refusal = appliance_.PrepareCheck(/*opens=*/true, actor); !refusal.empty())
      return done(AnswerOf(refusal));
    store_.Write(&Store::audit, std::move(done),
                 [=](AuditStore& audit) { audit.Log(actor, "check.open", "", Message()); });
  }

  void LeaveCheck(const Actor& actor, Done done) override {
    done(AnswerOf(appliance_.PrepareCheck(/*opens=*/false, actor)));
  }

  void SetCheckBaseline(const Actor& actor, const std::string& check_id, const std::string& reason,
                        Done done) override {
    store_.Write(&Store::checks, std::move(done),
                 [=](CheckStore& checks) { checks.SetBaseline(actor, check_id, reason); });
  }

 private:
  Appliance& appliance_;
  const ReferenceGate& references_;
  StoreAccess& store_;
};

class WebRoomCalibration final : public web::RoomCalibrationService {
 public:
  WebRoomCalibration(RoomInUse& room, StoreAccess& store) : room_(room), store_(store) {}

  web::RoomCalibrationStatus GetRoomCalibration() override {
    web::RoomCalibrationStatus status;
    if (!store_.IsThere()) return status;
    try {
      status = room_.Calibration();
    } catch (const std::exception& error) {
      Log(LogLevel::kError,
          fmt::format("the room's calibration cannot be read from the store: {}", error.what()));
      status.due = status.why_not_sign = MessageOf(error);
    }
    return status;
  }

  void SignRoomCalibration(const Actor& actor, const std::string& digest, Done done) override {
    const auto [serial, since] = room_.ScansWanted();
    // StoreAccess calls nothing once the services are destroyed, and the room outlives them.
    store_.Write(
        &Store::room,
        [&room = room_, done = std::move(done)](const Change& answer) {
          if (answer.result == ChangeResult::kDone) room.Refresh();
          done(answer);
        },
        [=, serial = serial, since = since](RoomStore& room) {
          return room.Sign(actor, serial, since, digest);
        });
  }

  void SignCouch(const Actor& actor, const CouchProfile& couch, Done done) override {
    store_.Write(&Store::couch, std::move(done),
                 [=](CouchStore& stored) { return stored.Sign(actor, couch); });
  }

  std::optional<std::string> RoomBoardPdf(Message& why_not) override {
    try {
      return room_.BoardPdf();
    } catch (const std::exception& error) {
      why_not = MessageOf(error);
      return std::nullopt;
    }
  }

 private:
  RoomInUse& room_;
  StoreAccess& store_;
};

class WebSensorProfiles final : public web::SensorProfileService {
 public:
  WebSensorProfiles(Appliance& appliance, SharedParts& shared, web::BackgroundWork& background,
                    StoreAccess& store)
      : appliance_(appliance),
        config_(shared.given.config),
        profiles_(shared.profiles),
        notices_(shared.notices),
        background_(background),
        store_(store) {}

  SensorProfiles GetSensorProfiles() override { return profiles_.OfConnected(); }

  SensorRepeats GetSensorRepeats() override {
    const SensorProfiles connected = profiles_.OfConnected();
    if (!connected.why_none.empty())
      return {.serial = connected.serial, .why_none = connected.why_none};
    return RepeatsOf(connected.serial, NewestScans(), *profiles_.shelf(), WallClock::now());
  }

  void JudgeSensorRepeats(const Actor& actor, const std::string& serial, Done done) override {
    if (RefuseIf(appliance_.WhyNotIdle(), done)) return;
    if (RefuseIf(profiles_.WhyNotChange(serial), done)) return;
    const auto failure = std::make_shared<Change>(DoneWith(""));
    const auto judge = [=, this, options = config_.compare, shelf = profiles_.shelf()] {
      try {
        const std::vector<Scan> scans = NewestScans();
        const auto now = WallClock::now();
        JudgeRepeatsOf(RepeatsOf(serial, scans, *shelf, now), scans, options, actor, *shelf, now);
      } catch (const DataError& error) {
        *failure = Refused(ChangeResult::kConflict, error.message());
      } catch (const std::exception& error) {
        *failure = Refused(ChangeResult::kFailed, MessageOf(error));
      }
    };
    const auto log = [=, this, done = std::move(done)] {
      if (failure->result != ChangeResult::kDone) return done(*failure);
      store_.Write(&Store::audit, done, [=](AuditStore& audit) {
        audit.Log(actor, "sensor.judged", serial, Message());
      });
    };
    if (!background_.RunInBackground(web::BackgroundPool::kFiles, judge, log)) {
      *failure = Refused(ChangeResult::kFailed, say::store::RepeatsBusy());
      log();
    }
  }

  std::optional<std::string> SensorProfileFile(int version) override {
    return profiles_.FileOf(version);
  }

  void ResetSensorProfile(const Actor& actor, const std::string& serial, Done done) override {
    ChangeProfile(serial, done, [=, shelf = profiles_.shelf()](AuditStore& audit) {
      const int version = shelf->Reset(serial);
      audit.Log(actor, "profile.reset", serial, say::audit::ProfileVersion(version));
    });
  }

  void RollBackSensorProfile(const Actor& actor, const std::string& serial, int version,
                             Done done) override {
    ChangeProfile(serial, done, [=, shelf = profiles_.shelf()](AuditStore& audit) {
      try {
        const int made = shelf->RollBack(serial, version);
        audit.Log(actor, "profile.roll_back", serial, say::audit::ProfileRolledBack(version, made));
      } catch (const DataError& error) {
        throw StoreRefusal(ChangeResult::kNotFound, error.message());
      }
    });
  }

 private:
  [[nodiscard]] std::vector<Scan> NewestScans() const {
    constexpr int kLooked = 20;
    return store_.Read(&Store::scans, [](ScanStore& scans) { return scans.List("", kLooked); });
  }
  /// As StoreAccess::Change(); afterwards the last scan's objection to the profile is discarded.
  void ChangeProfile(const std::string& serial, const Done& done,
                     std::function<void(AuditStore&)> change) {
    if (RefuseIf(appliance_.WhyNotIdle(), done)) return;
    if (RefuseIf(profiles_.WhyNotChange(serial), done)) return;
    store_.Write(
        &Store::audit,
        [this, done](const Change& answer) {
          if (answer.result == ChangeResult::kDone) {
            profiles_.SetDrift({});
            notices_.TellPage(web::EventKind::kStatus);
          }
          done(answer);
        },
        std::move(change));
  }

  Appliance& appliance_;
  const Config& config_;
  UnitProfiles& profiles_;
  Notices& notices_;
  web::BackgroundWork& background_;
  StoreAccess& store_;
};

}  // namespace

std::unique_ptr<web::CheckService> MakeWebChecks(Appliance& appliance,
                                                 const ReferenceGate& references,
                                                 StoreAccess& store) {
  return std::make_unique<WebChecks>(appliance, references, store);
}

std::unique_ptr<web::RoomCalibrationService> MakeWebRoomCalibration(RoomInUse& room,
                                                                    StoreAccess& store) {
  return std::make_unique<WebRoomCalibration>(room, store);
}

std::unique_ptr<web::SensorProfileService> MakeWebSensorProfiles(Appliance& appliance,
                                                                 SharedParts& shared,
                                                                 web::BackgroundWork& background,
                                                                 StoreAccess& store) {
  return std::make_unique<WebSensorProfiles>(appliance, shared, background, store);
}

}  // namespace plumb
