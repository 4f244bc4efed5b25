// SPDX-License-Identifier: Apache-2.0
// Linked in place of no_store_commands.cpp in a build with the appliance.
#include "daemon/cli/commands.hpp"

namespace plumb {

std::span<const CommandEntry> StoreCommands() {
  static constexpr CommandEntry kCommands[] = {
      {"backup", "Back up the data of plumbd: database, scans, calibrations; also while it runs",
       AddBackup},
      {"restore", "Restore a state folder from a backup, after checking every file of it",
       AddRestore},
      {"verify-log", "Check a downloaded audit log: whether it is as it was written", AddVerifyLog},
      {"authority", "Print the certificate of the unit's own authority, for tablets that trust it",
       AddAuthority},
      {"export-patient", "Export one patient from a state folder or a backup", AddExportPatient},
      {"import-patient", "Import an exported patient into a state folder", AddImportPatient},
      {"factory-reset", "Reset plumbd's stored data to the state of delivery", AddFactoryReset},
  };
  return kCommands;
}

}  // namespace plumb
