// A virtual sensor for demos and tests: a driver plug-in of OpenNI2 that plays sweeps rendered
// beforehand.
#pragma once

#include <filesystem>
#include <memory>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/virtual/openni/virtual_session.hpp"
#include "drivers/virtual/virtual_scenes.hpp"

namespace plumb {

/// The private copy of libOpenNI2.so.0 whose drivers are the plug-in and the file player, and
/// nothing else: `lib/plumb/virtual-sensor` in a parent folder of the running program, in the build
/// tree as after an installation.
/// @throws IoError saying what is missing.
[[nodiscard]] std::filesystem::path FindVirtualSensorRuntime();

/// Renders what is not in the cache yet and sets the stage for the plug-in. The sensor itself
/// appears in an OpenNiProvider that is made with runtime_library() and calibration_folder() while
/// this object lives; then Command() works too.
///
/// Only one lives in a process at a time. The constructor sets an environment variable that the
/// plug-in reads: make it before other threads start, and destroy it after the provider and its
/// sensors. Command() and its shorthands may be called from any thread, wait for the plug-in's
/// answer for at most a second, and throw DeviceError if there is none or the command is refused.
///
/// The frames of the virtual camera: it holds still at the beginning of the current scene; Rewind()
/// plays the sweep once from its start, then holds its last view. NextScene() goes to the next
/// scene (after the last comes the first) and holds still at its beginning. Stamps always run on,
/// and within a sweep they are those of the simulator.
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
  /// Holds `SERIAL.yaml` of the virtual unit; other serials have none.
  [[nodiscard]] const std::filesystem::path& calibration_folder() const {
    return session_->calibration_folder();
  }
  /// Names of the scenes in the order in which NextScene() shows them.
  [[nodiscard]] const std::vector<std::string>& scenes() const { return scenes_; }
  [[nodiscard]] int frames() const { return frames_; }
  /// Where the plug-in listens; datagrams with one command each, the answer goes to the sender.
  [[nodiscard]] const std::filesystem::path& socket() const { return session_->socket(); }

  /// Sends one line as listed in drivers/virtual/README.md and returns the answer without its
  /// leading "ok".
  std::string Command(std::string_view command) const { return session_->Command(command); }

  void Plug() const { (void)Command("plug"); }
  void Unplug() const { (void)Command("unplug"); }
  void Stall() const { (void)Command("stall"); }    ///< No frames come, nothing is reported.
  void Resume() const { (void)Command("resume"); }  ///< Ends a stall and an error.
  void Error() const { (void)Command("error"); }  ///< The driver reports a failure and frames stop.
  void NextScene() const { (void)Command("next-scene"); }
  void Rewind() const { (void)Command("rewind"); }
  /// The driver finishes its current command and stops listening: for OpenNiOptions::before_stop.
  void Quit() const noexcept;

 private:
  std::filesystem::path runtime_library_;
  std::vector<std::string> scenes_;
  int frames_ = 0;
  std::unique_ptr<const VirtualSession> session_;
};

}  // namespace plumb
