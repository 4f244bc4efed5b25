// Backups of the state folder, and restoring them.
//
// A backup is a folder: plumb.db, scans/, set-aside/, calibration/ and imports/ as they were,
// SHA256SUMS of every file (in the format of `sha256sum -c`) and backup.json about the whole. It
// appears complete or not at all. With a secret every file except the last two is encrypted
// (file_cipher.hpp). A target that ends in ".tar" is one file, an archive of the same.
#pragma once

#include <cstdint>
#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/files/atomic_folder.hpp"

namespace plumb {

class BackupSecret;
class Database;

[[nodiscard]] OutputKind BackupOutput();

struct BackupReport {
  std::size_t scans = 0, files = 0;
  std::uint64_t bytes = 0;
  /// Files in the store that are not as they were stored: "scan 000004: scene/cloud.ply is
  /// missing". The backup contains what exists.
  std::vector<std::string> problems;
  /// Of RestoreOver(): folder with what was stored before; empty if there was nothing.
  std::filesystem::path replaced = {};
};

/// A backup in the words of the audit log.
[[nodiscard]] std::string Described(const std::filesystem::path& target, const BackupReport& report,
                                    bool is_encrypted);

/// Backs up an open store, whose files must not be removed meanwhile. The database is copied as of
/// one moment, with the scans that it then contains. Files are copied (sharing blocks until one
/// side is written to, if the file system can); each is read once. An older backup at `target` is
/// replaced, and nothing else.
/// @throws IoError if the backup cannot be written; Interrupted
[[nodiscard]] BackupReport WriteBackup(const std::filesystem::path& state, Database& database,
                                       const std::filesystem::path& target,
                                       const std::stop_token& stop = {},
                                       const BackupSecret* secret = nullptr);

/// Backs up a state folder that no plumbd uses, and notes that in its audit log.
/// @throws as above; IoError if the folder has no store, or a process uses it.
[[nodiscard]] BackupReport BackUpStopped(const std::filesystem::path& state,
                                         const std::filesystem::path& target,
                                         const std::stop_token& stop = {},
                                         const BackupSecret* secret = nullptr);

/// Restores a state folder from a backup. Every file is compared with SHA256SUMS, and the database
/// is checked, before anything is written. A state folder left by an interrupted restore has no
/// database, so plumbd starts in safe mode. The first start has an entry in the audit log about it.
/// @param state  Missing or empty. Its owner becomes the files' owner if the process may set it.
/// @throws DataError if the backup is not complete, naming the first wrong file, or the secret is
///         not the one of the encryption; std::invalid_argument if the state folder is in use;
///         IoError; Interrupted
BackupReport RestoreBackup(const std::filesystem::path& backup, const std::filesystem::path& state,
                           const std::stop_token& stop = {}, const BackupSecret* secret = nullptr);

/// The same into a state folder that is not empty and that no plumbd works with. Once the backup is
/// verified and unpacked, what it replaces is moved to a new folder before-restore-N in there:
/// nothing of it is overwritten or removed. Keys and other files that no backup has stay.
/// @throws as above; DatabaseBusy if a plumbd works with it
BackupReport RestoreOver(const std::filesystem::path& backup, const std::filesystem::path& state,
                         const std::stop_token& stop = {}, const BackupSecret* secret = nullptr);

/// True after RestoreOver() was interrupted, such as by a power cut, after it had unpacked the
/// backup and before that was in place. It can be called again.
[[nodiscard]] bool IsRestoreInterrupted(const std::filesystem::path& state);

/// Adds the entry of a restore to the audit log, at the first start after it.
/// @throws IoError and its kinds
void NoteRestore(const std::filesystem::path& state, Database& database);

}  // namespace plumb
