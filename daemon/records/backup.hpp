// Backups of the state folder, and what is made of one.
//
// A backup is a folder: plumb.db, scans/, set-aside/, calibration/ and imports/ as they were,
// SHA256SUMS of every file (as `sha256sum -c` reads it) and backup.json about the whole. It appears
// whole or not at all. With a secret every file but the last two is encrypted (file_cipher.hpp).
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
  /// What is in the store but not as it was stored: "scan 000004: scene/cloud.ply is missing". The
  /// backup holds what is there.
  std::vector<std::string> problems;
};

/// Of a store that is open; its files may not be removed meanwhile. The database is copied as it is
/// at one moment, and the scans that it knows then. Files are copied (their blocks are shared until
/// one side is written to, where the file system can); each is read once. An older backup at
/// `target` is replaced.
/// @throws IoError if the backup cannot be written; Interrupted
[[nodiscard]] BackupReport WriteBackup(const std::filesystem::path& state, Database& database,
                                       const std::filesystem::path& target,
                                       const std::stop_token& stop = {},
                                       const BackupSecret* secret = nullptr);

/// Of a state folder that no plumbd uses.
/// @throws as above; IoError if the folder holds no store, or a process uses it.
[[nodiscard]] BackupReport BackUpStopped(const std::filesystem::path& state,
                                         const std::filesystem::path& target,
                                         const std::stop_token& stop = {},
                                         const BackupSecret* secret = nullptr);

/// Makes a state folder of a backup. Every file is held against SHA256SUMS, and the database is
/// checked, before anything is written. A state folder that an interrupted restore left has no
/// database: plumbd then starts in safe mode.
/// @param state  Missing or empty. Its owner becomes the files' owner where the process may do so.
/// @throws DataError if the backup is not whole, naming the first file that is not, or the secret
/// is not the one that it was encrypted with;
/// std::invalid_argument if the state folder is in use; IoError; Interrupted
BackupReport RestoreBackup(const std::filesystem::path& backup, const std::filesystem::path& state,
                           const std::stop_token& stop = {}, const BackupSecret* secret = nullptr);

}  // namespace plumb
