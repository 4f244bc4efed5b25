// Backups and diagnostics.
#pragma once

#include "web/service/change.hpp"
#include "web/service/service_types.hpp"

namespace plumb::web {

/// The rules of services.hpp hold.
class MaintenanceService {
 public:
  virtual ~MaintenanceService() = default;

  /// Makes a backup in the configured folder, while scans continue; answers when it is done.
  /// kInvalid if no folder is configured. The message names files that were not as they were
  /// stored.
  virtual void MakeBackup(const Actor& actor, Done done) = 0;
  /// Returns a file (without patient data) that is downloaded once and then removed.
  virtual void WriteDiagnostics(const Actor& actor, Done done) = 0;
};

}  // namespace plumb::web
