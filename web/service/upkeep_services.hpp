// SPDX-License-Identifier: Apache-2.0
// Settings and templates of plans, backups and diagnostics, system updates, the restart after them,
// and the reset to the state of delivery.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "web/model/account.hpp"
#include "web/model/change.hpp"
#include "web/model/patient.hpp"
#include "web/model/settings.hpp"
#include "web/model/status.hpp"

namespace plumb::web {

/// The rules of services.hpp hold.
class SettingsService {
 public:
  virtual ~SettingsService() = default;

  [[nodiscard]] virtual Settings GetSettings() = 0;
  /// kInvalid names the field. Settings that are not part of the change keep what is stored when it
  /// is made.
  virtual void ChangeSettings(const Actor& actor, const SettingsChange& change, Done done) = 0;
  [[nodiscard]] virtual std::vector<PlanTemplate> Templates() = 0;  ///< By site.
  /// Replaces the template of that site; at most 100 sites.
  virtual void SetTemplate(const Actor& actor, const PlanTemplate& wanted, Done done) = 0;
  virtual void RemoveTemplate(const Actor& actor, const std::string& site, Done done) = 0;
};

/// The rules of services.hpp hold.
class MaintenanceService {
 public:
  virtual ~MaintenanceService() = default;

  /// Makes a backup in the configured folder, while scans continue; answers when it is done.
  /// kInvalid if no folder is configured. The message names files that were not as they were
  /// stored.
  virtual void MakeBackup(const Actor& actor, Done done) = 0;
  /// A person has opened a backup with its private key, elsewhere, and verified it: noted in the
  /// log.
  virtual void NoteBackupVerified(const Actor& actor, Done done) = 0;
  /// Returns a file (without patient data) that is downloaded once and then removed.
  virtual void WriteDiagnostics(const Actor& actor, Done done) = 0;
  /// Sends a test message by every way that the configuration names; answers when each has taken
  /// it, or one has not (kFailed). kInvalid if it names none.
  virtual void SendTestMessage(const Actor& actor, Done done) = 0;
};

/// The rules of services.hpp hold.
class UpdateService {
 public:
  virtual ~UpdateService() = default;

  [[nodiscard]] virtual UpdateStatus GetUpdate() = 0;
  /// Checks a file's format and moves it to the bundles under that name (NAME.raucb). kInvalid: not
  /// a bundle.
  virtual void AddBundle(const Actor& actor, const std::filesystem::path& file,
                         const std::string& name, Done done) = 0;
  /// Names of bundles on plugged-in USB sticks, as the last look found them. Begins another look;
  /// EventKind::kUpdate if it finds others.
  [[nodiscard]] virtual std::vector<std::string> StickBundles() = 0;
  /// Copies one of them, then continues as InstallUpdate(); the copy is not listed as a bundle.
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
