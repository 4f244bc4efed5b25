// SPDX-License-Identifier: Apache-2.0
// Backups of the state folder, and restoring them.
//
// A backup is a folder: plumb.db, scans/, set-aside/, calibration/ and imports/ as they were,
// SHA256SUMS of every file (in the format of `sha256sum -c`) and backup.json about the whole. It
// appears complete or not at all. A target that ends in ".tar" is one file, an archive of the same;
// one for recipients is encrypted and ends in ".tar.age" (summed_folder.hpp).
#pragma once

#include <cstdint>
#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "daemon/archive/summed_folder.hpp"
#include "daemon/files/age_recipients.hpp"
#include "daemon/files/atomic_folder.hpp"

namespace plumb {

class Database;

[[nodiscard]] OutputKind BackupOutput();

struct BackupReport {
  std::size_t scans = 0, files = 0;
  /// Of a backup that was made: the scans whose files it holds completely, as they were stored.
  std::vector<std::string> whole_scans = {};
  std::uint64_t bytes = 0;
  /// Files in the store that are not as they were stored: "scan 000004: scene/cloud.ply is
  /// missing". The backup contains what exists.
  std::vector<Message> problems;
  /// Of a backup that was made: its place, which ends in ".tar.age" if it is encrypted.
  std::filesystem::path target = {};
  /// Of an encrypted backup that was made: why its restore was not rehearsed; empty: it was.
  Message unrehearsed = {};
  /// Of RestoreOver(): folder with what was stored before; empty if there was nothing.
  std::filesystem::path replaced = {};
};

/// A backup in the words of the audit log.
[[nodiscard]] Message Described(const BackupReport& report, bool is_encrypted);

/// Backs up an open store, whose files must not be removed meanwhile. The database is copied as of
/// one moment, with the scans that it then contains. Files are copied (sharing blocks until one
/// side is written to, if the file system can); each is read once. An older backup at `target` is
/// replaced, and nothing else. For recipients, its restore is rehearsed (rehearsal.hpp) before it
/// appears.
/// @param target  Changed as by EncryptedName() for recipients.
/// @throws IoError if the backup cannot be written; DataError if it could not be restored;
///         Interrupted
[[nodiscard]] BackupReport WriteBackup(const std::filesystem::path& state, Database& database,
                                       const std::filesystem::path& target,
                                       const std::stop_token& stop = {},
                                       const AgeRecipients& recipients = {});

/// Backs up a state folder that no plumbd uses, and notes that in its audit log.
/// @throws as above; IoError if the folder has no store, or a process uses it.
[[nodiscard]] BackupReport BackUpStopped(const std::filesystem::path& state,
                                         const std::filesystem::path& target,
                                         const std::stop_token& stop = {},
                                         const AgeRecipients& recipients = {});

/// Restores a state folder from a backup. Every file is compared with SHA256SUMS, and the database
/// is checked, before anything is written. A state folder left by an interrupted restore has no
/// database, so plumbd starts in safe mode. The first start has an entry in the audit log about it.
/// @param state  Missing or empty. Its owner becomes the files' owner if the process may set it.
/// @param keys  Of an encrypted backup, which is decrypted into a file without a name beside what
/// is
///              restored: that takes as much room once more.
/// @throws DataError if the backup is not complete, naming the first wrong file, or the keys do not
///         open it; InvalidRequest if the state folder is in use; IoError; Interrupted
BackupReport RestoreBackup(const std::filesystem::path& backup, const std::filesystem::path& state,
                           const std::stop_token& stop = {}, const BackupKeys& keys = {});

/// Verifies every file of a backup, and its database, without restoring it. What is decrypted takes
/// room in the folder of temporary files (TMPDIR). The report has the numbers of scans and files.
/// @throws as above
BackupReport VerifyBackup(const std::filesystem::path& backup, const std::stop_token& stop,
                          const BackupKeys& keys);

/// The same as RestoreBackup() into a state folder that is not empty and that no plumbd works with.
/// Once the backup is verified and unpacked, what it replaces is moved to a new folder
/// before-restore-N in there: nothing of it is overwritten or removed. Keys and other files that no
/// backup has stay.
/// @throws as above; DatabaseBusy if a plumbd works with it
BackupReport RestoreOver(const std::filesystem::path& backup, const std::filesystem::path& state,
                         const std::stop_token& stop = {}, const BackupKeys& keys = {});

}  // namespace plumb
