#include "daemon/records/store_backup.hpp"

#include "daemon/records/audit_store.hpp"
#include "daemon/records/backup_place.hpp"

namespace plumb {

BackupReport StoreBackup::Make(const web::Actor& actor, const std::filesystem::path& target,
                               const std::stop_token& stop, const BackupSecret* secret) {
  RequireLastingPlace(target, folders_.state());
  const RemovalGate::Backup guard(gate_);
  BackupReport report;
  {
    Database source(folders_.state() / "plumb.db", Database::Access::kReadOnly);
    report = WriteBackup(folders_.state(), source, target, stop, secret);
  }
  AuditStore(database_).Log(actor, "backup.make", "", Described(target, report, secret != nullptr));
  return report;
}

}  // namespace plumb
