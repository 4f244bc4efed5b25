// SPDX-License-Identifier: Apache-2.0
#include "daemon/unit/unit_recovery.hpp"

#include <grp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>

#include "algo/base/errors.hpp"
#include "daemon/archive/age_file.hpp"
#include "daemon/archive/backup.hpp"
#include "daemon/archive/file_cipher.hpp"
#include "daemon/config/config_section.hpp"
#include "daemon/database/retry_while_busy.hpp"
#include "daemon/records/store.hpp"
#include "drivers/files/file_io.hpp"
#include "words/upkeep.hpp"

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
    throw IoError(
        say::upkeep::CannotRecover(state.string(), std::system_category().message(errno)));
  if (owner.st_uid == 0) return;
  const uid_t uid = owner.st_uid;
  const gid_t gid = owner.st_gid;
  if (::setgroups(0, nullptr) != 0 || ::setresgid(gid, gid, gid) != 0 ||
      ::setresuid(uid, uid, uid) != 0) {
    throw IoError(
        say::upkeep::RightsOfOwner(state.string(), std::system_category().message(errno)));
  }
  if (::setuid(0) == 0) throw IoError(say::upkeep::RightsOfRoot());
}

template <typename Action>
auto WhenFree(const RecoveryWait& wait, const Action& action) {
  constexpr std::chrono::milliseconds kPause(100);
  return RetryWhileBusy(wait.longest, kPause, wait.sleep, action);
}

Message Confirm(int num_lost, const fs::path& state, const RecoveryWait& wait) {
  BecomeOwnerOf(state);
  WhenFree(wait, [&] {
    FolderLock lock;
    lock.Take(state);
    ConfirmLostScans(state, num_lost);
  });
  return say::upkeep::ConfirmedLost(num_lost);
}

/// A stick can hold any backup: the public keys are no secret, so that a backup encrypted for them
/// proves nothing. The identity does.
void RequireOneOf(const AgeRecipients& recipients, const AgeIdentity& identity) {
  for (const std::string& key : identity.Recipients()) {
    const std::vector<std::string>& known = recipients.keys();
    if (std::find(known.begin(), known.end(), key) != known.end()) return;
  }
  throw DataError(say::upkeep::IdentityNotOfUnit());
}

Message Restore(const UnitRecovery& given, const fs::path& state, const UnitBackupKeys& configured,
                const RecoveryWait& wait) {
  std::optional<BackupSecret> secret;
  std::optional<AgeIdentity> identity;
  if (!given.identity.empty()) {
    identity.emplace(given.identity);
    if (!configured.recipients.empty()) {
      RequireOneOf(configured.recipients, *identity);
    } else if (!configured.key_file.empty()) {
      throw DataError(say::upkeep::UnitHasKeyOnly(configured.key_file.string()));
    }
  }
  if (!configured.key_file.empty()) {  // a key on the stick would bypass the unit's own
    if (!given.key_file.empty())
      throw DataError(say::upkeep::UnitHasKey(configured.key_file.string()));
    if (!identity) secret.emplace(configured.key_file);
  } else if (!configured.recipients.empty()) {
    if (!identity) throw DataError(say::upkeep::UnitNeedsIdentity());
  } else if (!given.key_file.empty()) {
    secret.emplace(given.key_file, BackupSecret::Readers::kAny);
  }
  const BackupKeys keys{.identity = identity ? &*identity : nullptr,
                        .secret = secret ? &*secret : nullptr};
  BecomeOwnerOf(state);
  const BackupReport report =
      WhenFree(wait, [&] { return RestoreOver(given.backup, state, {}, keys); });
  return say::upkeep::Restored(given.backup.string(), static_cast<std::int64_t>(report.scans),
                               static_cast<std::int64_t>(report.files),
                               report.replaced.empty()
                                   ? say::upkeep::NoPreviousData()
                                   : say::upkeep::PreviousData(report.replaced.string()));
}

}  // namespace

UnitRecovery ReadUnitRecovery(const fs::path& file) {
  const std::string name = file.string();
  const toml::table root = ParseToml(ReadTextFile(file, kMaxRecoveryBytes), name);
  RejectUnknownTables(root, name, {"recovery"});
  const auto is_path = [](const std::string& value) { return !value.empty(); };
  UnitRecovery given;
  std::string backup, key_file, identity;
  Section section(root, "recovery", name);
  section.Take("lost_scans", given.lost_scans, say::config::ExpectedLostScans(),
               [](int number) { return number >= 2; });
  section.Take("restore", backup, say::config::ExpectedBackup(), is_path);
  section.Take("key_file", key_file, say::config::ExpectedBackupKey(), is_path);
  section.Take("identity", identity, say::config::ExpectedIdentity(), is_path);
  section.RejectUnknownKeys();
  if (given.lost_scans.has_value() == !backup.empty())
    throw DataError(say::upkeep::LostOrRestore(name));
  if (backup.empty() && !(key_file.empty() && identity.empty()))
    throw DataError(say::upkeep::KeyWithoutRestore(name));
  const fs::path folder = fs::absolute(file).parent_path();
  // An absolute path stays as it is.
  if (!backup.empty()) given.backup = folder / backup;
  if (!key_file.empty()) given.key_file = folder / key_file;
  if (!identity.empty()) given.identity = folder / identity;
  return given;
}

Message RecoverUnit(const UnitRecovery& given, const fs::path& state,
                    const UnitBackupKeys& configured, const RecoveryWait& wait) {
  try {
    return given.lost_scans ? Confirm(*given.lost_scans, state, wait)
                            : Restore(given, state, configured, wait);
  } catch (const DatabaseBusy&) {
    throw DataError(say::upkeep::StateInUse(state.string()));
  }
}

}  // namespace plumb
