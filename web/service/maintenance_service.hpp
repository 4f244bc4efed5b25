// Backups and diagnostics.
#pragma once

#include "web/service/change.hpp"
#include "web/service/service_types.hpp"

namespace plumb::web {

/// The rules of services.hpp hold.
class MaintenanceService {
 public:
  virtual ~MaintenanceService() = default;

  /// In the configured folder, while scans go on; answers when it is done. kInvalid where no folder
  /// is configured. The message names what was not as it was stored.
  virtual void MakeBackup(const Actor& actor, Done done) = 0;
  /// Gives a file (no patient data in it) that is downloaded once and then removed.
  virtual void WriteDiagnostics(const Actor& actor, Done done) = 0;
};

}  // namespace plumb::web
