// SPDX-License-Identifier: Apache-2.0
// `plumb record`: records a sensor's images into a folder or an .oni file.
#include <algorithm>
#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/common_options.hpp"
#include "daemon/cli/language.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/config/sensor_settings.hpp"
#include "daemon/files/atomic_folder.hpp"
#include "daemon/loop/bounded_queue.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "drivers/replay/tum_writer.hpp"
#include "words/cli.hpp"
#include "words/file.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

struct RecordArguments {
  fs::path out;
  double seconds = 10.0;
  std::string serial;
  fs::path calibration = "/var/lib/plumb/calibration";
  std::optional<std::string> simulated;
  bool jpeg = false;
  MethodOptions method;
};

constexpr std::size_t kQueue = 120;             // frames of 2 MB that wait for the encoder
constexpr double kDepthUnitsPerMetre = 1000.0;  // as sensors deliver it
constexpr double kSimulatedRate_hz = 30.0;

/// The driver whose sensors can be recorded in this format; null: a folder, from any sensor.
const SensorDriver& DriverFor(const RecordingKind* kind, const Config& config, bool simulated) {
  const SensorRegistry& registry = BuiltInSensors();
  const std::string& wanted = config.appliance.sensor_driver;
  if (kind == nullptr || !wanted.empty()) return registry.Choose(wanted, simulated);
  for (const SensorDriver& driver : registry.drivers()) {
    const std::vector<std::string> names = kind->drivers();
    if (driver.is_simulated == simulated &&
        std::find(names.begin(), names.end(), driver.name) != names.end())
      return driver;
  }
  return registry.Choose("", simulated);
}

/// The sensor that is recorded, and the objects it needs.
struct Attached {
  std::unique_ptr<SensorSetup> setup;
  std::unique_ptr<SensorProvider> provider;
  std::unique_ptr<LiveSensor> sensor;

  Attached(const RecordArguments& options, const RecordingKind* kind, const Config& config,
           const std::stop_token& stop, Progress& progress) {
    SensorSettings settings = SensorSettingsOf(config);
    settings.calibration_folder = options.calibration;
    // Without a configuration no room is stated, and the file of the sensor may name its markers.
    settings.markers_are_the_rooms = options.method.config_file.has_value();
    SimulatedSweeps sweeps;
    sweeps.suite = options.simulated.value_or(sweeps.suite);
    sweeps.max_scenes = 1;
    sweeps.frames = std::max(2, static_cast<int>(options.seconds * kSimulatedRate_hz));
    setup = DriverFor(kind, config, options.simulated.has_value())
                .set_up(settings, sweeps, stop, [&](double fraction, std::string_view scene) {
                  progress.Update(say::cli::Rendering(), fraction, Message::Verbatim(scene));
                });
    provider = setup->MakeProvider();
    sensor = OpenSensor(*provider, options.serial);
    sensor->LockExposure(true);
  }

  /// Recording begins now.
  void Begin() const {
    setup->BeforeScan();
    sensor->Flush();
  }
};

/// The frames of a sensor until the time is over.
class FramesForATime : public FrameSource {
 public:
  FramesForATime(LiveSensor& sensor, double seconds, const std::stop_token& stop,
                 Progress& progress)
      : sensor_(sensor), seconds_(seconds), stop_(stop), progress_(progress) {}

  [[nodiscard]] const StreamInfo& info() const override { return sensor_.info(); }
  /// @throws Interrupted on a stop request.
  [[nodiscard]] std::optional<Frame> Next() override {
    if (stop_.stop_requested()) throw Interrupted(say::cli::RecordingStopped());
    std::optional<Frame> frame = sensor_.Next();
    if (!frame) return frame;
    if (!begin_s_) begin_s_ = frame->depth_time_s;
    const double passed_s = frame->depth_time_s - *begin_s_;
    if (passed_s >= seconds_) return std::nullopt;
    ++num_frames_;
    progress_.Update(say::cli::Recording(), passed_s / seconds_, say::cli::Frames(num_frames_));
    return frame;
  }
  [[nodiscard]] std::int64_t num_frames() const { return num_frames_; }

 private:
  LiveSensor& sensor_;
  const double seconds_;
  const std::stop_token stop_;
  Progress& progress_;
  std::optional<double> begin_s_;
  std::int64_t num_frames_ = 0;
};

Message RecordFile(const RecordArguments& options, const RecordingKind& kind,
                   const Attached& attached, const std::stop_token& stop, Progress& progress) {
  FileRecorder::Summary summary;
  WriteFileAtomically(options.out, [&](const fs::path& hidden) {
    FramesForATime frames(*attached.sensor, options.seconds, stop, progress);
    if (options.simulated) {
      // Its driver is not one whose own recorder could listen.
      attached.Begin();
      kind.Write(hidden, frames, stop, {}, options.jpeg);
      const auto num_frames = static_cast<std::size_t>(frames.num_frames());
      summary = {num_frames, num_frames};
    } else {
      const std::unique_ptr<FileRecorder> recorder =
          kind.Record(*attached.sensor, hidden, options.jpeg);
      attached.Begin();
      while (frames.Next()) {
      }
      summary = recorder->Finish();
    }
    const fs::path beside = kind.SideCar(options.out);
    std::error_code error;
    fs::rename(kind.SideCar(hidden), beside, error);
    if (error) throw IoError(say::file::CannotWrite(beside.string(), error.message()));
  });
  return say::cli::RecordedImages(static_cast<std::int64_t>(summary.num_color),
                                  static_cast<std::int64_t>(summary.num_depth));
}

Message RecordFolder(const RecordArguments& options, const Attached& attached,
                     const std::stop_token& stop, Progress& progress) {
  AtomicFolder folder(options.out, RecordingOutput());
  const TumWriterOptions writing{.depth_scale = kDepthUnitsPerMetre,
                                 .jpeg_quality = options.jpeg ? 92 : 0};
  TumWriter writer(folder.path(), attached.sensor->info(), writing);
  BoundedQueue<Frame> queue(kQueue);
  int num_dropped = 0;
  std::int64_t num_frames = 0;
  std::exception_ptr error;
  {
    const std::jthread encoder([&] {
      try {
        while (const std::optional<Frame> frame = queue.Pop()) writer.Add(*frame);
      } catch (...) {
        error = std::current_exception();
        queue.Close();
      }
    });
    try {
      attached.Begin();
      FramesForATime frames(*attached.sensor, options.seconds, stop, progress);
      while (std::optional<Frame> frame = frames.Next())
        num_dropped += queue.PushDroppingOldest(std::move(*frame));
      num_frames = frames.num_frames();
    } catch (...) {
      queue.Close();
      throw;
    }
    progress.Update(say::cli::Writing(), 0.0);
    queue.Close();
  }
  if (error) std::rethrow_exception(error);
  writer.Finish();
  folder.Commit();
  return num_dropped == 0 ? say::cli::RecordedFrames(num_frames)
                          : say::cli::RecordedWithLoss(num_frames, num_dropped);
}

int Run(const RecordArguments& options, const CommandContext& context) {
  const Config config = options.method.Read();
  Progress progress(context.language);
  const RecordingKind* kind = BuiltInSensors().KindWithExtension(options.out.extension().string());
  const Attached attached(options, kind, config, context.stop, progress);
  const Message what = kind != nullptr
                           ? RecordFile(options, *kind, attached, context.stop, progress)
                           : RecordFolder(options, attached, context.stop, progress);
  progress.Clear();
  std::string text = context.Said(say::cli::Recorded(options.out.string(), what,
                                                     attached.sensor->description().serial)) +
                     "\n";
  for (const Message& warning : attached.sensor->info().warnings)
    text += fmt::format("  {} {}\n", LeftAligned(context.Said(say::cli::WarningLabel()), 10),
                        context.Said(warning));
  PrintOut(text);
  return kDone;
}

}  // namespace

Command AddRecord(CLI::App& app) {
  auto options = std::make_shared<RecordArguments>();
  app.add_option(
         "--out", options->out,
         "Recording to write: a folder in the TUM RGB-D layout, or a file that ends in .oni")
      ->required()
      ->type_name("DIR|FILE.oni");
  app.add_option("--seconds", options->seconds, "Length")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str()
      ->type_name("S");
  app.add_option("--serial", options->serial,
                 "Serial number of the sensor, if several are attached")
      ->type_name("SERIAL");
  app.add_option("--calibration", options->calibration,
                 "Folder of the sensors' calibrations, SERIAL.yaml")
      ->capture_default_str()
      ->type_name("DIR");
  app.add_option("--simulated", options->simulated,
                 "Record from a virtual sensor that sweeps the first scene of this suite")
      ->check(CLI::IsMember({"demo", "nine", "patient"}))
      ->type_name("demo|nine|patient");
  app.add_flag("--jpeg", options->jpeg, "Colour as JPEG: much smaller, but not lossless");
  app.add_option("--config", options->method.config_file, "Markers of the room, as TOML")
      ->type_name("FILE");
  return [options](const CommandContext& context) { return Run(*options, context); };
}

}  // namespace plumb
