// SPDX-License-Identifier: Apache-2.0
// Exports one patient from a store and imports it into another.
//
// An export is a folder: record.json (the rows of the patient, sessions, scans, results, references
// and digests; for information also the patient's part of the audit log and the daily checks before
// the scans), the files of the scans, SHA256SUMS and patient.json about the whole. One file, an
// archive of the same, if its name ends in ".tar"; encrypted for recipients as a backup is.
#pragma once

#include <cstdint>
#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "daemon/archive/summed_folder.hpp"
#include "daemon/files/age_recipients.hpp"

namespace plumb {

struct PatientReport {
  std::string code;
  std::size_t scans = 0, references = 0, files = 0;
  std::uint64_t bytes = 0;
  std::vector<Message> problems;  ///< As for a backup.
  bool was_there = false;         ///< Import: the same data exists already, and nothing was done.
};

/// @param state  A state folder that no plumbd uses, whose audit log notes the export; or the
///         folder of a backup that is not encrypted, which is not changed.
/// @throws DataError if there is no such patient; IoError; Interrupted
[[nodiscard]] PatientReport ExportPatient(const std::filesystem::path& state,
                                          const std::string& code,
                                          const std::filesystem::path& target,
                                          const std::stop_token& stop = {},
                                          const AgeRecipients& recipients = {});

/// Adds the patient with new numbers. Every reference becomes a draft, because it was approved in a
/// room with its own markers; a physicist here has to approve it again. The export's part of the
/// log and the checks are stored as imports/ID.json; the import itself is in the audit log.
/// @param state  A state folder that no plumbd uses.
/// @throws DataError if the export is not complete or is invalid; InvalidRequest if another
///         patient has the code, or this patient has other data; IoError; Interrupted. Nothing is
///         changed then.
PatientReport ImportPatient(const std::filesystem::path& folder, const std::filesystem::path& state,
                            const std::stop_token& stop = {}, const BackupKeys& keys = {});

}  // namespace plumb
