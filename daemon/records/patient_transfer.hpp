// One patient out of a store, and into another one.
//
// An export is a folder: record.json (the rows of the patient, sessions, scans, results, references
// and digests; with them, for reading only, the patient's part of the audit log and the daily
// checks before the scans), the files of the scans, SHA256SUMS and patient.json about the whole.
// Encrypted where a secret is given.
#pragma once

#include <cstdint>
#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

namespace plumb {

class BackupSecret;

struct PatientReport {
  std::string code;
  std::size_t scans = 0, references = 0, files = 0;
  std::uint64_t bytes = 0;
  std::vector<std::string> problems;  ///< As of a backup.
  bool was_there = false;             ///< Import: the same data is there already; nothing was done.
};

/// @param state  A state folder that no plumbd uses, or a backup that is not encrypted.
/// @throws DataError if there is no such patient; IoError; Interrupted
[[nodiscard]] PatientReport ExportPatient(const std::filesystem::path& state,
                                          const std::string& code,
                                          const std::filesystem::path& target,
                                          const std::stop_token& stop = {},
                                          const BackupSecret* secret = nullptr);

/// Adds the patient with new numbers. Every reference comes as a draft: it was approved in a room
/// with its own markers, and a physicist of this one approves it again. What the export says of
/// the log and of the checks is kept as imports/ID.json; that it was imported is in the audit log.
/// @param state  That no plumbd uses.
/// @throws DataError if the export is not whole or says what none can say; std::invalid_argument
/// if another patient has the code, or this one other data; IoError; Interrupted. Nothing is
/// changed then.
PatientReport ImportPatient(const std::filesystem::path& folder, const std::filesystem::path& state,
                            const std::stop_token& stop = {}, const BackupSecret* secret = nullptr);

}  // namespace plumb
