// SPDX-License-Identifier: Apache-2.0
// A virtual sensor for tests: an OpenNI2 driver plug-in that plays pre-rendered sweeps.
#pragma once

#include <filesystem>
#include <memory>
#include <stop_token>
#include <string>
#include <string_view>

#include "drivers/simulator/openni/virtual_session.hpp"
#include "drivers/simulator/player/virtual_scenes.hpp"

namespace plumb {

/// Renders what is not in the cache yet and prepares the session of the plug-in. The sensor itself
/// appears in an OpenNiProvider that is created with runtime_library() and calibration_folder()
/// while this object lives; then Command() works too.
///
/// Only one may exist in a process at a time. The constructor sets an environment variable that the
/// plug-in reads: create it before other threads start, and destroy it after the provider and its
/// sensors. Command() may be called from any thread, waits for the plug-in's answer for at most a
/// second, and throws DeviceError if there is none or the command is refused.
///
/// Frames of the virtual camera: it is static at the beginning of the current scene; "rewind" plays
/// the sweep once from its start and then holds the last view. "next-scene" goes to the next scene
/// (after the last comes the first) and is static at its beginning. Stamps always increase, and
/// within a sweep they are those of the simulator.
class VirtualSensor {
 public:
  /// Parameters and exceptions are those of RenderScenes(); IoError too if the driver tree cannot
  /// be used.
  explicit VirtualSensor(const VirtualSensorOptions& options, const std::stop_token& stop = {},
                         const SetUpProgress& progress = {});
  ~VirtualSensor();
  VirtualSensor(const VirtualSensor&) = delete;
  VirtualSensor& operator=(const VirtualSensor&) = delete;

  [[nodiscard]] const std::filesystem::path& runtime_library() const { return runtime_library_; }
  /// Contains `SERIAL.yaml` of the virtual unit; other serials have no file.
  [[nodiscard]] const std::filesystem::path& calibration_folder() const {
    return session_->calibration_folder();
  }

  /// Sends one line as listed in drivers/simulator/player/README.md and returns the answer without
  /// its leading "ok".
  std::string Command(std::string_view command) const { return session_->Command(command); }

  /// The driver finishes its current command and stops listening: for OpenNiOptions::before_stop.
  void Quit() const noexcept;

 private:
  std::filesystem::path runtime_library_;
  std::unique_ptr<const VirtualSession> session_;
};

}  // namespace plumb
