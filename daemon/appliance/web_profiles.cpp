#include "daemon/appliance/web_profiles.hpp"

#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"

namespace plumb {

using web::ChangeResult;

web::SensorProfiles WebSensorProfiles::GetSensorProfiles() { return appliance_.SensorProfiles(); }

std::optional<std::string> WebSensorProfiles::SensorProfileFile(int version) {
  return appliance_.SensorProfileFile(version);
}

void WebSensorProfiles::ChangeProfile(const std::string& serial, const web::Done& done,
                                      std::function<void(AuditStore&)> change) {
  if (const std::string why = appliance_.WhyNotChangeProfile(serial); !why.empty())
    return done(AnswerOf(why));
  store_.Change(
      &Store::audit,
      [this, done](const web::Change& answer) {
        if (answer.result == ChangeResult::kDone) appliance_.ForgetDrift();
        done(answer);
      },
      std::move(change));
}

void WebSensorProfiles::ResetSensorProfile(const web::Actor& actor, const std::string& serial,
                                           web::Done done) {
  ChangeProfile(serial, done, [=, shelf = appliance_.profiles()](AuditStore& audit) {
    const int version = shelf->Reset(serial);
    audit.Log(actor, "profile.reset", serial, fmt::format("version {}", version));
  });
}

void WebSensorProfiles::RollBackSensorProfile(const web::Actor& actor, const std::string& serial,
                                              int version, web::Done done) {
  ChangeProfile(serial, done, [=, shelf = appliance_.profiles()](AuditStore& audit) {
    try {
      const int made = shelf->RollBack(serial, version);
      audit.Log(actor, "profile.roll_back", serial,
                fmt::format("to version {}, which is version {} now", version, made));
    } catch (const DataError& error) {
      throw StoreRefusal(ChangeResult::kNotFound, error.what());
    }
  });
}

}  // namespace plumb
