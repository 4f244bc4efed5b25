// SPDX-License-Identifier: Apache-2.0
// The bin: files of scans that a person or the retention removed stay in scans/.bin for a month, in
// case that was a mistake. A wipe or a factory reset removes them at once, and so does want of
// room.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "daemon/database/database.hpp"
#include "daemon/database/scan_folders.hpp"

namespace plumb {

inline constexpr std::chrono::hours kTimeInBin{24 * 30};

/// To be called within the change that removes the scan's row.
void NoteInBin(Database& database, std::int64_t scan, std::int64_t patient);
/// Moves the scan's files to the bin, or removes them if they cannot be moved.
void MoveToBin(const ScanFolders& folders, const std::string& scan_id);
/// Notes scans that lie in the bin without a note, as after a crash: as put there now, and of no
/// patient.
void NoteStrayInBin(Database& database, const ScanFolders& folders);
/// Takes scans out of the bin that have been there for at least so long, and returns them. Times in
/// the future count as now. To be called within a change; the caller then removes the files.
[[nodiscard]] std::vector<std::string> TakeFromBin(Database& database, std::chrono::hours at_least);
/// The same for all scans of a patient.
[[nodiscard]] std::vector<std::string> TakeFromBin(Database& database, std::int64_t patient);

}  // namespace plumb
