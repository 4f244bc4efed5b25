// Options and little jobs that several commands share.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "algo/types/frame.hpp"
#include "algo/types/scene.hpp"
#include "daemon/config/config.hpp"

namespace CLI {
class App;
}

namespace plumb {

class Progress;
struct ScanProgress;

/// --preset, --config and --sensor-profile, and what they say together: the option on the line wins
/// over the file.
struct MethodOptions {
  std::optional<std::string> preset;
  std::optional<std::filesystem::path> config_file;
  std::optional<std::filesystem::path> profile_file;

  void AddTo(CLI::App& app);
  /// --sensor-profile, for commands that reconstruct.
  void AddSensorTo(CLI::App& app);
  /// The region file that the configuration names is read too.
  /// @throws DataError from either file.
  [[nodiscard]] Config Read() const;
};

/// Opens a recording of any kind that this build reads.
/// @throws DataError if it is none.
[[nodiscard]] std::unique_ptr<FrameSource> OpenRecording(const std::filesystem::path& path,
                                                         const MarkerConfig& markers);

/// Makes a folder and its parents where they are missing.
/// @throws IoError
void EnsureFolder(const std::filesystem::path& folder);

/// Shows a scan's progress; `prefix` goes before the step's name.
void Show(Progress& progress, const std::string& prefix, const ScanProgress& scan);

}  // namespace plumb
