// SPDX-License-Identifier: Apache-2.0
// Stores the profiles of the sensor units that the appliance has used, with their earlier versions.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "algo/sensor_calibration/sensor_profile.hpp"
#include "web/model/sensor_profile.hpp"

namespace plumb {

/// One version of a unit's profile.
struct ProfileVersion {
  int version = 0;
  std::chrono::system_clock::time_point made;
  ProfileCause cause = ProfileCause::kLearned;
  /// Not set: the unit starts again from its stated calibration.
  std::optional<SensorProfile> profile;
};

/// `FOLDER/SERIAL/VERSION.profile`: a line with the format and the SHA-256 of the rest, then JSON
/// with the profile as written by `plumb calibrate`. A version is never changed; the highest one is
/// in use. Thread-safe within one process.
class ProfileShelf {
 public:
  static constexpr int kKeptVersions = 20;

  explicit ProfileShelf(std::filesystem::path folder);

  /// Profile for the unit's next scan. Its name is "SERIAL version N".
  struct InUse {
    std::optional<ProfileVersion> newest;  ///< Not set if the unit has no version.
    int version = 0;  ///< The newest version after this call; 0 if there is none.
    /// If set, the newest version could not be read and was moved to FOLDER/set-aside; the sentence
    /// states where it is. Scans continue without a profile.
    Message fault;
  };
  /// Never throws because of the contents or errors of the disk. @param serial  Not empty.
  [[nodiscard]] InUse Read(const std::string& serial);

  /// Newest first; unreadable ones are left out.
  [[nodiscard]] std::vector<ProfileVersion> Versions(const std::string& serial) const;

  /// Adds a version learned from a sweep and returns its number.
  /// @param begun_from  InUse::version when the sweep began; not set: any.
  /// @throws DataError if another version was added meanwhile, so that a reset stays effective;
  ///         IoError
  int Add(const std::string& serial, const SensorProfile& profile,
          std::optional<int> begun_from = std::nullopt);
  /// The unit starts again from its stated calibration; earlier versions are kept. Returns the
  /// number. @throws IoError
  int Reset(const std::string& serial);
  /// Keeps what sweeps of a thing that did not move have shown about the unit; one text, the
  /// newest.
  /// @throws IoError
  void KeepRepeats(const std::string& serial, const std::string& json);
  /// Nothing if there is none that can be read.
  [[nodiscard]] std::optional<std::string> Repeats(const std::string& serial) const;
  /// Adds an earlier version again as the newest. Returns the number.
  /// @throws DataError if there is no version of that number with a profile; IoError
  int RollBack(const std::string& serial, int version);

 private:
  struct Entry {
    int version = 0;
    std::filesystem::path file;
  };
  [[nodiscard]] std::filesystem::path FolderOf(const std::string& serial) const;
  [[nodiscard]] std::vector<Entry> Entries(const std::string& serial) const;
  int Write(const std::string& serial, ProfileCause cause,
            const std::optional<SensorProfile>& profile);

  std::filesystem::path folder_;
  mutable std::mutex mutex_;
};

}  // namespace plumb
