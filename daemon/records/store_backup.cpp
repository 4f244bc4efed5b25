#include "daemon/records/store_backup.hpp"

#include <linux/magic.h>
#include <sys/statfs.h>

#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>

#include <fmt/format.h>

#include "daemon/records/audit_store.hpp"
#include "daemon/records/database.hpp"
#include "daemon/records/file_copy.hpp"

namespace plumb {

namespace fs = std::filesystem;

namespace {

/// Where the unit of plumbd may write.
constexpr const char* kAdvice =
    "name a folder on another disk, such as one that is mounted at "
    "/var/lib/plumb-backup";

/// Root, within its file system, of the mount that contains the path.
std::string MountedFolderOf(const fs::path& path, const std::string& mounts) {
  std::string root, nearest;
  std::istringstream lines(mounts);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream fields(line);
    std::string id, parent, device, its_root, point;
    if (!(fields >> id >> parent >> device >> its_root >> point)) continue;
    // Of two mounts at one place, the later covers the earlier.
    if (point.size() < nearest.size() || !IsBelow(path, point)) continue;
    nearest = point;
    root = its_root;
  }
  return root;
}

/// The folder may not exist yet; then its nearest existing parent counts.
bool IsInMemory(fs::path path) {
  std::error_code error;
  while (!fs::exists(path, error) && path.has_relative_path()) path = path.parent_path();
  struct statfs status {};
  return ::statfs(path.c_str(), &status) == 0 &&
         (status.f_type == TMPFS_MAGIC || status.f_type == RAMFS_MAGIC);
}

}  // namespace

std::string WhyBackupIsLostAt(const fs::path& target, const fs::path& state,
                              const std::string& mounts) {
  std::error_code error;
  fs::path place = fs::weakly_canonical(target, error);
  if (error) place = target;
  if (MountedFolderOf(place, mounts).find("systemd-private-") != std::string::npos) {
    return fmt::format(
        "no backup is made at {}: this folder of plumbd is visible to its service only and is "
        "deleted with it; {}",
        target.string(), kAdvice);
  }
  if (IsInMemory(place) && !IsInMemory(state)) {
    return fmt::format(
        "no backup is made at {}: this folder lies in memory and is empty after a restart of the "
        "machine; {}",
        target.string(), kAdvice);
  }
  return {};
}

void RequireLastingPlace(const fs::path& target, const fs::path& state) {
  std::ifstream file("/proc/self/mountinfo");
  const std::string mounts(std::istreambuf_iterator<char>(file), {});
  if (const std::string why = WhyBackupIsLostAt(target, state, mounts); !why.empty())
    throw std::invalid_argument(why);
}

BackupReport StoreBackup::Make(const Actor& actor, const std::filesystem::path& target,
                               const std::stop_token& stop, const BackupSecret* secret) {
  RequireLastingPlace(target, folders_.state());
  const RemovalGate::Backup guard(gate_);
  BackupReport report;
  {
    Database source(folders_.state() / kDatabaseFile, Database::Access::kReadOnly);
    report = WriteBackup(folders_.state(), source, target, stop, secret);
  }
  AuditStore(database_).Log(actor, "backup.make", "", Described(target, report, secret != nullptr));
  return report;
}

}  // namespace plumb
