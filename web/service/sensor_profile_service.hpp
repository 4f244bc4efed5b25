// What is known of the sensor unit.
#pragma once

#include <optional>
#include <string>

#include "web/service/change.hpp"
#include "web/service/service_types.hpp"

namespace plumb::web {

/// The rules of services.hpp hold.
class SensorProfileService {
 public:
  virtual ~SensorProfileService() = default;

  [[nodiscard]] virtual SensorProfiles GetSensorProfiles() = 0;  ///< (aside)
  /// One version as `plumb calibrate` writes it; nothing where there is none (aside).
  [[nodiscard]] virtual std::optional<std::string> SensorProfileFile(int version) = 0;
  /// The unit begins again from its stated calibration. @param serial  Of the unit that the person
  /// has seen; kConflict where another one is connected by now, and during a scan.
  virtual void ResetSensorProfile(const Actor& actor, const std::string& serial, Done done) = 0;
  /// Takes an earlier version back, as the newest. kNotFound where it holds no profile.
  virtual void RollBackSensorProfile(const Actor& actor, const std::string& serial, int version,
                                     Done done) = 0;
};

}  // namespace plumb::web
