#include "daemon/appliance/unit_recovery.hpp"

#include <grp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "daemon/config/config_section.hpp"
#include "daemon/records/backup.hpp"
#include "daemon/records/file_cipher.hpp"
#include "daemon/records/retry_while_busy.hpp"
#include "daemon/records/store.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxRecoveryBytes = 64 << 10;

/// Root reads what a stranger's stick holds, and writes where the account of plumbd may put links,
/// with no more rights than that account has.
void BecomeOwnerOf(const fs::path& state) {
  struct stat owner {};
  if (::geteuid() != 0) return;
  if (::stat(state.c_str(), &owner) != 0)
    throw IoError(fmt::format("cannot recover {}: {}", state.string(),
                              std::system_category().message(errno)));
  if (owner.st_uid == 0) return;
  const uid_t uid = owner.st_uid;
  const gid_t gid = owner.st_gid;
  if (::setgroups(0, nullptr) != 0 || ::setresgid(gid, gid, gid) != 0 ||
      ::setresuid(uid, uid, uid) != 0) {
    throw IoError(fmt::format("cannot take the rights of the owner of {}: {}", state.string(),
                              std::system_category().message(errno)));
  }
  if (::setuid(0) == 0) throw IoError("the rights of root can be taken back: nothing was changed");
}

template <typename Action>
auto WhenFree(const RecoveryWait& wait, const Action& action) {
  constexpr std::chrono::milliseconds kPause(100);
  return RetryWhileBusy(wait.longest, kPause, wait.sleep, action);
}

std::string Confirm(int num_lost, const fs::path& state, const RecoveryWait& wait) {
  BecomeOwnerOf(state);
  WhenFree(wait, [&] {
    FolderLock lock;
    lock.Take(state);
    ConfirmLostScans(state, num_lost);
  });
  return fmt::format("{} missing scans are confirmed as lost; this takes effect at the next start",
                     num_lost);
}

std::string Restore(const UnitRecovery& given, const fs::path& state,
                    const fs::path& configured_key, const RecoveryWait& wait) {
  std::optional<BackupSecret> secret;
  if (!configured_key.empty()) {  // a key on the stick would bypass the unit's own
    if (!given.key_file.empty())
      throw DataError(fmt::format("the unit has a key for backups, {}: leave recovery.key_file out",
                                  configured_key.string()));
    secret.emplace(configured_key);
  } else if (!given.key_file.empty()) {
    secret.emplace(given.key_file, BackupSecret::Readers::kAny);
  }
  BecomeOwnerOf(state);
  const BackupReport report = WhenFree(
      wait, [&] { return RestoreOver(given.backup, state, {}, secret ? &*secret : nullptr); });
  return fmt::format(
      "restored from {}: {} scans, {} files; {}", given.backup.string(), report.scans, report.files,
      report.replaced.empty() ? "there was no previous data"
                              : "the previous data is in " + report.replaced.string());
}

}  // namespace

UnitRecovery ReadUnitRecovery(const fs::path& file) {
  const std::string name = file.string();
  const toml::table root = ParseToml(ReadTextFile(file, kMaxRecoveryBytes), name);
  RejectUnknownTables(root, name, {"recovery"});
  const auto is_path = [](const std::string& value) { return !value.empty(); };
  UnitRecovery given;
  std::string backup, key_file;
  Section section(root, "recovery", name);
  section.Take("lost_scans", given.lost_scans,
               "the number of missing scans that the page names in safe mode, at least 2",
               [](int number) { return number >= 2; });
  section.Take("restore", backup, "the folder of a backup, or its file", is_path);
  section.Take("key_file", key_file, "the name of a file with the key of the backup", is_path);
  section.RejectUnknownKeys();
  if (given.lost_scans.has_value() == !backup.empty())
    throw DataError(fmt::format("{}: recovery: expected either lost_scans or restore", name));
  if (backup.empty() && !key_file.empty())
    throw DataError(fmt::format("{}: recovery.key_file belongs to restore", name));
  const fs::path folder = fs::absolute(file).parent_path();
  // An absolute path stays as it is.
  if (!backup.empty()) given.backup = folder / backup;
  if (!key_file.empty()) given.key_file = folder / key_file;
  return given;
}

std::string RecoverUnit(const UnitRecovery& given, const fs::path& state,
                        const fs::path& configured_key, const RecoveryWait& wait) {
  try {
    return given.lost_scans ? Confirm(*given.lost_scans, state, wait)
                            : Restore(given, state, configured_key, wait);
  } catch (const DatabaseBusy&) {
    throw DataError(
        fmt::format("plumbd is using {}; nothing was recovered or changed", state.string()));
  }
}

}  // namespace plumb
