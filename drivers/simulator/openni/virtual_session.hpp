// SPDX-License-Identifier: Apache-2.0
// The session that the virtual sensor's plug-in plays, and the connection for commands.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/files/temporary.hpp"

namespace plumb {

/// The private copy of libOpenNI2.so.0 whose only drivers are the plug-in and the file player:
/// `lib/plumb/virtual-sensor` in a folder above the running program, in the build tree as after an
/// installation.
/// @throws IoError stating what is missing.
[[nodiscard]] std::filesystem::path FindVirtualSensorRuntime();

/// The folder that the plug-in reads when an OpenNI2 library with it starts. Only one may exist in
/// a process at a time. The constructor sets an environment variable, so create it before other
/// threads start, and destroy it after the library was stopped.
class VirtualSession {
 public:
  struct Contents {
    std::string serial = "VIRTUAL-0001";  ///< 1 to 64 letters, digits, - and _.
    bool plugged = true;
    std::vector<std::filesystem::path> scenes;  ///< Files as frame_cache.hpp describes them.
    std::string camera_file;                    ///< The calibration file of the unit.
  };
  /// @throws IoError; std::invalid_argument for a bad serial.
  explicit VirtualSession(const Contents& contents);
  ~VirtualSession();
  VirtualSession(const VirtualSession&) = delete;
  VirtualSession& operator=(const VirtualSession&) = delete;

  [[nodiscard]] const std::filesystem::path& calibration_folder() const {
    return calibration_folder_;
  }
  [[nodiscard]] const std::filesystem::path& socket() const { return socket_; }

  /// Sends one line as listed in drivers/simulator/player/README.md and returns the answer without
  /// its leading "ok". Callable from any thread; waits for at most a second.
  /// @throws DeviceError if there is no answer or the command is refused.
  std::string Command(std::string_view command) const;

 private:
  void Write(const Contents& contents) const;

  TemporaryFolder folder_;
  std::filesystem::path calibration_folder_;
  std::filesystem::path socket_;
};

}  // namespace plumb
