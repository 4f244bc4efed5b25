// The profiles of the sensor units that the appliance has used, each with its earlier versions.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "algo/sensor_model/sensor_profile.hpp"

namespace plumb {

/// One version of a unit's profile.
struct ProfileVersion {
  int version = 0;
  std::chrono::system_clock::time_point made;
  std::string cause;  ///< "learned", "rolled_back", "reset", "unreadable".
  /// None: from here on the unit begins again from its stated calibration.
  std::optional<SensorProfile> profile;
};

/// `FOLDER/SERIAL/VERSION.profile`: a line with the format and the SHA-256 of the rest, then JSON
/// with the profile as `plumb calibrate` writes it. A version is never changed; the highest one is
/// in use. Thread-safe within one process.
class ProfileShelf {
 public:
  static constexpr int kKeptVersions = 20;

  explicit ProfileShelf(std::filesystem::path folder);

  /// What the unit's next scan begins from. The profile is named "SERIAL version N".
  struct InUse {
    std::optional<ProfileVersion> newest;  ///< None: the unit has no version at all.
    int version = 0;                       ///< The newest after this call; 0: none.
    /// Set: the newest version could not be read and was moved to FOLDER/set-aside; the sentence
    /// says where it is. Scans go on without a profile.
    std::string fault;
  };
  /// Never throws for what the disk holds or refuses. @param serial  Not empty.
  [[nodiscard]] InUse Read(const std::string& serial);

  /// Newest first; those that cannot be read are left out.
  [[nodiscard]] std::vector<ProfileVersion> Versions(const std::string& serial) const;

  /// Adds a version that a sweep has taught; gives its number.
  /// @param begun_from  InUse::version when the sweep began; none: whatever it is.
  /// @throws DataError if another one was made meanwhile: what was reset stays reset; IoError
  int Add(const std::string& serial, const SensorProfile& profile,
          std::optional<int> begun_from = std::nullopt);
  /// The unit begins again; earlier versions stay. Gives the number. @throws IoError
  int Reset(const std::string& serial);
  /// Adds an earlier version again, as the newest. Gives the number.
  /// @throws DataError if there is none of that number that holds a profile; IoError
  int RollBack(const std::string& serial, int version);

 private:
  struct Entry {
    int version = 0;
    std::filesystem::path file;
  };
  [[nodiscard]] std::filesystem::path FolderOf(const std::string& serial) const;
  [[nodiscard]] std::vector<Entry> Entries(const std::string& serial) const;
  int Write(const std::string& serial, const char* cause,
            const std::optional<SensorProfile>& profile);

  std::filesystem::path folder_;
  mutable std::mutex mutex_;
};

}  // namespace plumb
