// SPDX-License-Identifier: Apache-2.0
#include "daemon/archive/store_backup.hpp"

#include <linux/magic.h>
#include <sys/statfs.h>

#include <fstream>
#include <iterator>
#include <sstream>
#include <utility>

#include "algo/base/errors.hpp"
#include "daemon/archive/backup_register.hpp"
#include "daemon/database/audit_store.hpp"
#include "daemon/database/database.hpp"
#include "daemon/scan_files/file_copy.hpp"
#include "words/backup.hpp"

namespace plumb {

namespace fs = std::filesystem;

namespace {

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

Message WhyBackupIsLostAt(const fs::path& target, const fs::path& state,
                          const std::string& mounts) {
  std::error_code error;
  fs::path place = fs::weakly_canonical(target, error);
  if (error) place = target;
  if (MountedFolderOf(place, mounts).find("systemd-private-") != std::string::npos)
    return say::backup::LostInService(target.string());
  if (IsInMemory(place) && !IsInMemory(state)) return say::backup::LostInMemory(target.string());
  return {};
}

void RequireLastingPlace(const fs::path& target, const fs::path& state) {
  std::ifstream file("/proc/self/mountinfo");
  const std::string mounts(std::istreambuf_iterator<char>(file), {});
  if (Message why = WhyBackupIsLostAt(target, state, mounts); !why.empty())
    throw InvalidRequest(std::move(why));
}

BackupReport StoreBackup::Make(const Actor& actor, const std::filesystem::path& target,
                               const std::stop_token& stop, const AgeRecipients& recipients) {
  RequireLastingPlace(target, folders_.state());
  const RemovalGate::Backup guard(gate_);
  BackupReport report;
  {
    Database source(folders_.state() / kDatabaseFile, Database::Access::kReadOnly);
    report = WriteBackup(folders_.state(), source, target, stop, recipients);
  }
  AuditStore(database_).Log(actor, "backup.make", "", Described(report, !recipients.empty()));
  const std::string sha256 = DigestOfBackup(report.target, stop);
  NoteBackup(*database_.ForChanges(), report, sha256);
  return report;
}

}  // namespace plumb
