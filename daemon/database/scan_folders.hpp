// SPDX-License-Identifier: Apache-2.0
// Locations of the files of scans in a state folder.
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

namespace plumb {

/// In the state folder, in a backup and in an export.
inline constexpr const char* kScansFolder = "scans";

/// STATE/scans/ID/, and STATE/scans/.staging-ID/ until the scan has ended.
class ScanFolders {
 public:
  /// @param state  An absolute path.
  explicit ScanFolders(std::filesystem::path state) : state_(std::move(state)) {}

  [[nodiscard]] const std::filesystem::path& state() const { return state_; }
  [[nodiscard]] std::filesystem::path scans() const { return state_ / kScansFolder; }
  [[nodiscard]] std::filesystem::path Scan(const std::string& scan_id) const {
    return scans() / scan_id;
  }
  [[nodiscard]] std::filesystem::path Staging(const std::string& scan_id) const {
    return scans() / (std::string(kStagingPrefix) + scan_id);
  }
  /// Where a start moves scan folders that have no row in the database. The second one is used if
  /// scans/ is on another disk than the rest.
  [[nodiscard]] std::array<std::filesystem::path, 2> SetAside() const {
    return {state_ / kSetAside, scans() / kSetAside};
  }
  /// Where the files of a removed scan stay for a while, on the same disk.
  [[nodiscard]] std::filesystem::path Bin(const std::string& scan_id) const {
    return scans() / kBin / scan_id;
  }
  /// What was set aside under a name that begins like this.
  [[nodiscard]] std::vector<std::filesystem::path> SetAsideAs(const std::string& begin) const;
  [[nodiscard]] static bool IsStaging(const std::filesystem::path& folder) {
    return folder.filename().string().starts_with(kStagingPrefix);
  }
  /// The folders of scans and of staging, by name. @throws DiskRefused
  [[nodiscard]] std::vector<std::filesystem::path> All() const;

  static constexpr const char* kSetAside = "set-aside";
  static constexpr const char* kBin = ".bin";
  /// After the number of an interrupted scan whose folder was complete at the next start.
  static constexpr const char* kInterruptedSuffix = "-interrupted";

 private:
  static constexpr const char* kStagingPrefix = ".staging-";

  std::filesystem::path state_;
};

}  // namespace plumb
