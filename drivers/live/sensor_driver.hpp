// What a driver of live sensors gives the programs, and the list of the drivers in this build.
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

#include "drivers/replay/tum_recording.hpp"
#include "drivers/sensor.hpp"

namespace plumb {

/// Settings of the installation that every driver of sensors obeys.
struct SensorSettings {
  /// Holds `SERIAL.yaml` for each calibrated unit, as camera.yaml; its depth_scale is ignored, live
  /// depth is in millimetres. A unit without one gets nominal intrinsics from its field of view,
  /// and a warning.
  std::filesystem::path calibration_folder = "/var/lib/plumb/calibration";
  std::string marker_dictionary =
      "DICT_6X6_250";  ///< Used where the calibration file does not state it; so are the next two.
  double marker_length_m = 0.104;
  std::optional<int> reference_marker = {};
  /// The three above are the room's: a calibration file that states other markers is refused. Off
  /// for recordings and the virtual sensor, whose file is all that is known of their markers.
  bool markers_are_the_rooms = false;
};

/// What a simulated sensor shows; drivers of real ones ignore it.
struct SimulatedSweeps {
  std::string suite = "demo";  ///< demo, nine or patient, as `plumb simulate` has them.
  unsigned seed = 1;
  int frames = 300;  ///< A sweep, 30 a second.
  int width = 640, height = 480;
  std::size_t max_scenes = 0;  ///< Only so many of the suite's scenes; 0: all.
  bool plugged = true;         ///< Whether the unit is attached at the start.
  /// Of the markers of the board of the room's calibration, on its sheet, by id: three scenes of it
  /// come first. Empty: none does.
  std::map<int, Eigen::Vector2d> board_centres_m = {};
};

/// Called while a driver prepares itself, with the fraction done and what it works on.
using SetUpProgress = std::function<void(double fraction, std::string_view what)>;

/// A driver that is ready for use in this process. It outlives its providers.
class SensorSetup {
 public:
  virtual ~SensorSetup() = default;

  /// Called on the thread that will use the provider; again after the earlier one was destroyed.
  /// @throws DeviceError if the driver's library cannot be used.
  [[nodiscard]] virtual std::unique_ptr<SensorProvider> MakeProvider() const = 0;

  /// A scan is about to start. Only a simulated sensor has something to do then.
  virtual void BeforeScan() const {}

  /// Changes what a simulated sensor does, as drivers/virtual/README.md lists it, and returns its
  /// answer. Any thread. @throws DeviceError if the command is refused.
  // NOLINTNEXTLINE(modernize-use-nodiscard)
  virtual std::string Command(const std::string& command) const;
};

/// Something `plumb doctor` reports of a driver, beside its sensors.
struct SensorFinding {
  enum class State { kGood, kNote, kBad } state = State::kGood;
  std::string what, found, remedy;
};

/// A driver of live sensors. To add one: drivers/README.md.
struct SensorDriver {
  std::string name;           ///< As `driver` in the [sensor] table names it.
  std::string title;          ///< For people, such as "OpenNI2".
  bool is_simulated = false;  ///< Its images are invented: refused where patients are scanned.
  /// Called once, before other threads start. The sweeps matter to simulated sensors only.
  /// @throws DeviceError, IoError, std::invalid_argument; Interrupted on a stop.
  std::function<std::unique_ptr<SensorSetup>(const SensorSettings&, const SimulatedSweeps&,
                                             const std::stop_token&, const SetUpProgress&)>
      set_up;
  /// May be empty. Must not throw.
  std::function<std::vector<SensorFinding>()> examine = {};
};

/// Writes what an open sensor sees into a file, from its making until Finish().
class FileRecorder {
 public:
  struct Summary {
    std::size_t num_color = 0, num_depth = 0;  ///< Images in the file.
  };
  virtual ~FileRecorder() = default;
  /// Waits for what is held back. @throws IoError
  virtual Summary Finish() = 0;
};

/// A kind of recording file that a driver brings along. The folder of images (TUM RGB-D layout) is
/// there for every sensor and is not listed here.
class RecordingKind {
 public:
  virtual ~RecordingKind() = default;
  [[nodiscard]] virtual std::string extension() const = 0;  ///< With its dot.
  /// The drivers whose sensors it can record.
  [[nodiscard]] virtual std::vector<std::string> drivers() const = 0;
  [[nodiscard]] virtual bool IsOne(const std::filesystem::path& file) const = 0;
  /// @throws DataError, IoError
  [[nodiscard]] virtual std::unique_ptr<FrameSource> Open(
      const std::filesystem::path& file, const RecordingDefaults& defaults) const = 0;
  /// Stamps of the depth images in seconds, found without decoding any. @throws DataError
  [[nodiscard]] virtual std::vector<double> DepthStamps(
      const std::filesystem::path& file) const = 0;
  /// @param file  A new file, in a folder that exists. @throws DeviceError, IoError
  [[nodiscard]] virtual std::unique_ptr<FileRecorder> Record(LiveSensor& sensor,
                                                             const std::filesystem::path& file,
                                                             bool jpeg) const = 0;
  /// What belongs to a recording and lies beside it; moved with it.
  [[nodiscard]] virtual std::filesystem::path SideCar(const std::filesystem::path& file) const = 0;
  /// Writes frames from anywhere into a new file. @param each  Called after each frame.
  /// @throws DataError, IoError, Interrupted
  virtual void Write(const std::filesystem::path& file, FrameSource& source,
                     const std::stop_token& stop, const std::function<void()>& each) const = 0;
};

/// The drivers that a program knows, in the order of preference.
class SensorRegistry {
 public:
  /// @throws std::invalid_argument if the name is empty or taken, or the driver cannot be set up.
  void Add(SensorDriver driver);
  void Add(std::unique_ptr<const RecordingKind> kind);

  /// The driver of that name; for an empty name the first of the kind that is wanted. If the build
  /// has none of that kind, a driver whose provider cannot be made, so that everything else works.
  /// @param simulated  Whether a simulated sensor is wanted.
  /// @throws DataError if the name is unknown or of the other kind; the message names what is
  /// known.
  [[nodiscard]] const SensorDriver& Choose(const std::string& name, bool simulated) const;

  /// The kind whose files end so; null: none.
  [[nodiscard]] const RecordingKind* KindWithExtension(std::string_view extension) const;
  /// The kind of a file that exists, by its contents; null: none of these.
  [[nodiscard]] const RecordingKind* KindOf(const std::filesystem::path& file) const;

  [[nodiscard]] const std::vector<SensorDriver>& drivers() const { return drivers_; }

 private:
  std::vector<SensorDriver> drivers_;
  std::vector<std::unique_ptr<const RecordingKind>> kinds_;
};

/// What this build has, collected from the folders below drivers/ when it is configured.
[[nodiscard]] const SensorRegistry& BuiltInSensors();

}  // namespace plumb
