// Backups of a store that is in use.
#include "daemon/records/store.hpp"
#include "daemon/records/store_internal.hpp"

#include <fmt/format.h>

namespace plumb {

namespace {

/// Says so to whoever wants to remove files meanwhile.
class WhileBackingUp {
 public:
  WhileBackingUp(std::mutex& removals, std::atomic<bool>& flag) : flag_(flag) {
    const std::lock_guard lock(removals);  // a removal that has begun ends first
    if (flag_.exchange(true))
      throw StoreRefusal(web::ChangeResult::kConflict, "a backup is being made already");
  }
  ~WhileBackingUp() { flag_ = false; }
  WhileBackingUp(const WhileBackingUp&) = delete;
  WhileBackingUp& operator=(const WhileBackingUp&) = delete;

 private:
  std::atomic<bool>& flag_;
};

}  // namespace

BackupReport Store::Backup(const web::Actor& actor, const std::filesystem::path& target,
                           const std::stop_token& stop, const BackupSecret* secret) {
  const WhileBackingUp guard(removal_mutex_, backing_up_);
  BackupReport report;
  {
    Database source(folder_ / "plumb.db", Database::Access::kReadOnly);
    report = WriteBackup(folder_, source, target, stop, secret);
  }
  Log(actor, "backup.make", "",
      fmt::format("{}: {} scans, {} files, {} bytes, {} problems{}", target.string(), report.scans,
                  report.files, report.bytes, report.problems.size(),
                  secret != nullptr ? ", encrypted" : ""));
  return report;
}

std::unique_lock<std::mutex> Store::LockRemovals() {
  std::unique_lock lock(removal_mutex_);
  if (backing_up_)
    throw StoreRefusal(web::ChangeResult::kConflict,
                       "a backup is being made, and nothing is removed meanwhile: try again when "
                       "it is done");
  return lock;
}

}  // namespace plumb
