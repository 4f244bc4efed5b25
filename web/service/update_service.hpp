// System updates, the restart after them, and the reset to the state of delivery.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "web/service/change.hpp"
#include "web/service/factory_reset.hpp"
#include "web/service/service_types.hpp"

namespace plumb::web {

/// The rules of services.hpp hold.
class UpdateService {
 public:
  virtual ~UpdateService() = default;

  [[nodiscard]] virtual UpdateStatus GetUpdate() = 0;
  /// Checks a file's format and moves it to the bundles under that name (NAME.raucb). kInvalid: not
  /// a bundle.
  virtual void AddBundle(const Actor& actor, const std::filesystem::path& file,
                         const std::string& name, Done done) = 0;
  /// Names of bundles on plugged-in USB sticks.
  [[nodiscard]] virtual std::vector<std::string> StickBundles() = 0;
  /// Copies one of them to the bundles, then continues as InstallUpdate().
  virtual void InstallFromStick(const Actor& actor, const std::string& bundle, Done done) = 0;
  virtual void RemoveBundle(const Actor& actor, const std::string& name, Done done) = 0;
  virtual void InstallUpdate(const Actor& actor, const std::string& bundle,
                             Done done) = 0;  ///< kConflict during a scan.
  /// Restarts the machine. kConflict during a treatment session, a scan and an installation.
  virtual void RestartSystem(const Actor& actor, Done done) = 0;
  /// Resets to the state of delivery, with an immediate restart of the machine. kConflict as for
  /// RestartSystem(); if the machine does not restart, nothing is reset.
  virtual void ResetToFactory(const Actor& actor, FactoryReset kind, Done done) = 0;
  /// Acknowledges a roll-back, which is then no longer reported.
  virtual void ForgetRollBack(const Actor& actor, Done done) = 0;
};

}  // namespace plumb::web
