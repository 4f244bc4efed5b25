// SPDX-License-Identifier: Apache-2.0
// Options and helper functions that several commands share.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "algo/types/frame.hpp"
#include "algo/types/scene.hpp"
#include "daemon/config/config.hpp"
#include "daemon/files/atomic_folder.hpp"

namespace CLI {
class App;
}

namespace plumb {

class Progress;
struct ScanProgress;

/// Configuration of the appliance where none is named.
inline constexpr const char* kDefaultConfig = "/etc/plumb/plumb.toml";

/// The combined --preset, --config and --sensor-profile; options on the command line take
/// precedence over the file.
struct MethodOptions {
  std::optional<std::string> preset;
  std::optional<std::filesystem::path> config_file;
  std::optional<std::filesystem::path> profile_file;

  void AddTo(CLI::App& app);
  /// --sensor-profile, for commands that reconstruct.
  void AddSensorTo(CLI::App& app);
  /// Also reads the region file that the configuration names.
  /// @throws DataError from either file.
  [[nodiscard]] Config Read() const;
};

/// Opens a recording of any kind that this build reads, other programs' too.
/// @param rate_hz  Of folders of images without time stamps; nothing: as their reader assumes.
/// @throws DataError if it is not a recording.
[[nodiscard]] std::unique_ptr<FrameSource> OpenRecording(const std::filesystem::path& path,
                                                         const StatedMarkers& markers,
                                                         std::optional<double> rate_hz = {});

/// Creates a folder and its missing parents.
/// @throws IoError
void EnsureFolder(const std::filesystem::path& folder);

/// Shows a scan's progress; the name, if any, is printed before the step.
void Show(Progress& progress, const std::string& name, const ScanProgress& scan);

/// A recording, as TumWriter writes it.
[[nodiscard]] OutputKind RecordingOutput();

}  // namespace plumb
