// The profile of the sensor unit.
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

  [[nodiscard]] virtual SensorProfiles GetSensorProfiles() = 0;  ///< (background)
  /// One version as written by `plumb calibrate`; nothing if there is none (background).
  [[nodiscard]] virtual std::optional<std::string> SensorProfileFile(int version) = 0;
  /// The unit starts again from its stated calibration.
  /// @param serial  Serial of the unit that the user has seen; kConflict if another one is
  ///         connected, and during a scan.
  virtual void ResetSensorProfile(const Actor& actor, const std::string& serial, Done done) = 0;
  /// Restores an earlier version as the newest. kNotFound if it holds no profile.
  virtual void RollBackSensorProfile(const Actor& actor, const std::string& serial, int version,
                                     Done done) = 0;
};

}  // namespace plumb::web
