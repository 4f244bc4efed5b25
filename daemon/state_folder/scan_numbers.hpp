// SPDX-License-Identifier: Apache-2.0
// Numbers of scans are printed on reports, so none is ever given twice, not even after an older
// backup was restored.
#pragma once

#include <cstdint>
#include <filesystem>

#include "daemon/database/database.hpp"
#include "daemon/database/scan_folders.hpp"

namespace plumb {

/// File in the state folder with the highest number given so far. No backup contains it.
inline constexpr const char* kLastScan = "last-scan";

/// The highest number that this database gave to a scan.
[[nodiscard]] std::int64_t LastScanNumber(Database& database);
/// The highest number given in this state folder, according to kLastScan and to the folders of
/// scans, including those that a restore replaced.
[[nodiscard]] std::int64_t LastScanNumber(const ScanFolders& folders);
/// The next scan gets a higher number than this. @throws IoError and its kinds
void NumberScansAbove(Database& database, std::int64_t number);
/// Notes the number in the state folder. A failure to write is ignored: the database has the
/// number, too.
void NoteScanNumber(const std::filesystem::path& state, std::int64_t number);

}  // namespace plumb
