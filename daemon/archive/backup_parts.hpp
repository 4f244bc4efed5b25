// SPDX-License-Identifier: Apache-2.0
// What a backup consists of.
#pragma once

#include <algorithm>
#include <array>
#include <filesystem>
#include <string>
#include <string_view>

#include "daemon/database/database.hpp"
#include "daemon/database/scan_folders.hpp"

namespace plumb {

/// About the whole.
inline constexpr const char* kAboutBackup = "backup.json";
/// The parts of a state folder, beside database and scans, that are copied if they exist.
inline constexpr std::array<const char*, 4> kOtherFolders = {ScanFolders::kSetAside, "calibration",
                                                             "imports", "sensor-profiles"};

/// True for the paths that a backup can contain: nothing outside it, nothing unknown.
[[nodiscard]] inline bool BackupMayHold(const std::string& path) {
  const std::string first = std::filesystem::path(path).begin()->string();
  return path == kDatabaseFile ||
         (first != path &&
          (first == kScansFolder ||
           std::find(kOtherFolders.begin(), kOtherFolders.end(), first) != kOtherFolders.end()));
}

}  // namespace plumb
