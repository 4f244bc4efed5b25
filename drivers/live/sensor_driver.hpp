// SPDX-License-Identifier: Apache-2.0
// The interface between sensor drivers and the programs, and the list of the drivers in this build.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "algo/base/message.hpp"
#include "algo/types/marker.hpp"
#include "drivers/replay/tum_recording.hpp"
#include "drivers/sensor.hpp"

namespace plumb {

/// Installation settings that every sensor driver uses.
struct SensorSettings {
  /// Contains `SERIAL.yaml` for each calibrated unit, in the format of camera.yaml. Its depth_scale
  /// is ignored, because live depth is in millimetres. A unit without a file gets nominal
  /// intrinsics from its field of view, and a warning.
  std::filesystem::path calibration_folder = "/var/lib/plumb/calibration";
  /// Where the driver "stream" listens.
  std::filesystem::path stream_socket = "/run/plumb/sensor.sock";
  /// File or name of a maker's library; empty: the newest installed one.
  std::filesystem::path library = {};
  /// Exposure of colour images during a scan; 0: automatic.
  double exposure_us = 0.0;
  /// Used where the calibration file states nothing.
  RoomMarkers room_markers = {};
  /// The value above describes the room: a calibration file that states other markers is
  /// refused. Only drivers of simulated sensors switch this off: the file of such a unit is the
  /// only source for its markers.
  bool markers_are_the_rooms = true;
};

/// Sweeps shown by a simulated sensor; drivers of real sensors ignore them.
struct SimulatedSweeps {
  std::string suite = "demo";  ///< demo, nine or patient, as `plumb simulate` has them.
  unsigned seed = 1;
  int frames = 300;               ///< Frames per sweep.
  int width = 640, height = 480;  ///< Or 320 x 240.
  std::size_t max_scenes = 0;     ///< Limit of the number of scenes; 0: all.
  /// Also what a sensor at rest sees of the body of the last scene, while it breathes, and after it
  /// was moved by 5 mm.
  bool at_rest = false;
  /// With `at_rest`: also after the couch was brought in steps to where the first scene's body lay.
  bool rest_steps = false;
  /// With `at_rest`: of a second unit, which sees the same body from its other side; empty: none.
  std::string second_serial = {};
  bool plugged = true;  ///< Whether the unit is attached at the start.
  /// Centres of the room calibration board's markers on its sheet, by id. If set, three scenes of
  /// the board come first.
  std::map<int, Eigen::Vector2d> board_centres_m = {};
  /// Seed of another room for the same bodies, as SimulateOptions::room.
  std::optional<unsigned> room = std::nullopt;
};

/// Called during the set-up of a driver with the completed fraction and the current step.
using SetUpProgress = std::function<void(double fraction, std::string_view what)>;

/// A driver that is ready for use in this process. It outlives its providers.
class SensorSetup {
 public:
  virtual ~SensorSetup() = default;

  /// Called on the thread that will use the provider; called again after the previous provider was
  /// destroyed.
  /// @throws DeviceError if the driver's library cannot be used.
  [[nodiscard]] virtual std::unique_ptr<SensorProvider> MakeProvider() const = 0;

  /// Called before a scan starts. Only simulated sensors use it.
  virtual void BeforeScan() const {}

  /// Controls a simulated sensor by the commands in drivers/simulator/player/README.md, and returns
  /// its answer. Callable from any thread.
  /// @throws DeviceError if the command is refused.
  // NOLINTNEXTLINE(modernize-use-nodiscard)
  virtual std::string Command(const std::string& command) const;
};

/// A line of `plumb doctor` about a driver, in addition to its sensors.
struct SensorFinding {
  enum class State { kGood, kNote, kBad } state = State::kGood;
  Message what, found, remedy;
};

/// A driver of live sensors. To add one: drivers/README.md.
struct SensorDriver {
  std::string name;           ///< Name for `driver` in the [sensor] table.
  std::string title;          ///< Name for people, such as "OpenNI2".
  bool is_simulated = false;  ///< Its images are rendered: refused where patients are scanned.
  /// Its units bring a calibration of their own, from the factory or from the program that feeds
  /// them, for images of any size. Those of other drivers have nominal intrinsics until a file
  /// states theirs, and images of 640x480 or of the same shape.
  bool states_camera = false;
  /// Called once, before other threads start. Only simulated sensors use the sweeps.
  /// @throws DeviceError, IoError, std::invalid_argument; Interrupted on a stop request.
  std::function<std::unique_ptr<SensorSetup>(const SensorSettings&, const SimulatedSweeps&,
                                             const std::stop_token&, const SetUpProgress&)>
      set_up;
  /// May be empty. Must not throw.
  std::function<std::vector<SensorFinding>(const SensorSettings&)> examine = {};
};

/// Opens a sensor as SensorProvider::Open() does, and checks what its driver states of it, so that
/// no scan begins that could not be reconstructed.
/// @throws DeviceError also if StreamInfo::depth_noise is impossible.
[[nodiscard]] std::unique_ptr<LiveSensor> OpenSensor(SensorProvider& provider,
                                                     const std::string& serial);

/// Records an open sensor into a file, from construction until Finish().
class FileRecorder {
 public:
  struct Summary {
    std::size_t num_color = 0, num_depth = 0;  ///< Images in the file.
  };
  virtual ~FileRecorder() = default;
  /// Waits until buffered images are written. @throws IoError
  virtual Summary Finish() = 0;
};

/// A recording file format that a driver provides. The folder of images (TUM RGB-D layout) is
/// available for every sensor and not listed here.
class RecordingKind {
 public:
  virtual ~RecordingKind() = default;
  [[nodiscard]] virtual std::string extension() const = 0;  ///< Including the dot.
  /// Drivers whose sensors it can record.
  [[nodiscard]] virtual std::vector<std::string> drivers() const = 0;
  [[nodiscard]] virtual bool IsOne(const std::filesystem::path& file) const = 0;
  /// @throws DataError, IoError
  [[nodiscard]] virtual std::unique_ptr<FrameSource> Open(
      const std::filesystem::path& file, const RecordingDefaults& defaults) const = 0;
  /// Stamps of the depth images in seconds, without decoding any image. @throws DataError
  [[nodiscard]] virtual std::vector<double> DepthStamps(
      const std::filesystem::path& file) const = 0;
  /// @param file  A new file, in a folder that exists. @throws DeviceError, IoError
  [[nodiscard]] virtual std::unique_ptr<FileRecorder> Record(LiveSensor& sensor,
                                                             const std::filesystem::path& file,
                                                             bool jpeg) const = 0;
  /// Files beside a recording that belong to it and are moved with it.
  [[nodiscard]] virtual std::filesystem::path SideCar(const std::filesystem::path& file) const = 0;
  /// Writes frames from any source into a new file.
  /// @param each  Called after each frame. @param jpeg  Colour as JPEG, which is not lossless.
  /// @throws DataError, IoError, Interrupted
  virtual void Write(const std::filesystem::path& file, FrameSource& source,
                     const std::stop_token& stop, const std::function<void()>& each,
                     bool jpeg) const = 0;
};

/// The drivers known to a program, in order of preference.
class SensorRegistry {
 public:
  /// @throws std::invalid_argument if the name is empty or taken, or the driver has no set-up
  ///         function.
  void Add(SensorDriver driver);
  void Add(std::unique_ptr<const RecordingKind> kind);

  /// The driver with that name; for an empty name the first of the requested kind. If the build has
  /// no driver of that kind, returns one whose provider cannot be created, so that everything else
  /// works.
  /// @param simulated  Whether a simulated sensor is requested.
  /// @throws DataError if the name is unknown or of the other kind; the message lists the known
  ///         names.
  [[nodiscard]] const SensorDriver& Choose(const std::string& name, bool simulated) const;

  /// The format with this file extension; null if there is none.
  [[nodiscard]] const RecordingKind* KindWithExtension(std::string_view extension) const;
  /// The format of an existing file, from its contents; null if there is none.
  [[nodiscard]] const RecordingKind* KindOf(const std::filesystem::path& file) const;

  [[nodiscard]] const std::vector<SensorDriver>& drivers() const { return drivers_; }

 private:
  std::vector<SensorDriver> drivers_;
  std::vector<std::unique_ptr<const RecordingKind>> kinds_;
};

/// The drivers of this build, collected from the folders in drivers/ when it is configured.
[[nodiscard]] const SensorRegistry& BuiltInSensors();

}  // namespace plumb
