#include "drivers/virtual/openni/virtual_openni_driver.hpp"

#include <memory>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "drivers/openni/oni_file.hpp"
#include "drivers/openni/oni_recorder.hpp"
#include "drivers/openni/oni_recording.hpp"
#include "drivers/openni/openni_provider.hpp"
#include "drivers/virtual/openni/oni_writer.hpp"
#include "drivers/virtual/openni/virtual_sensor.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

class VirtualOpenNiSetup : public SensorSetup {
 public:
  VirtualOpenNiSetup(const SensorSettings& settings, const SimulatedSweeps& sweeps,
                     const std::stop_token& stop, const SetUpProgress& progress)
      : sensor_(VirtualSensorOptions{sweeps}, stop, progress), options_{settings} {
    options_.library = sensor_.runtime_library();
    options_.calibration_folder = sensor_.calibration_folder();
    options_.markers_are_the_rooms = false;
    options_.before_stop = [this] { sensor_.Quit(); };
  }

  [[nodiscard]] std::unique_ptr<SensorProvider> MakeProvider() const override {
    return std::make_unique<OpenNiProvider>(options_);
  }
  void BeforeScan() const override { (void)sensor_.Command("rewind"); }
  std::string Command(const std::string& command) const override {
    return sensor_.Command(command);
  }

 private:
  VirtualSensor sensor_;
  OpenNiOptions options_;
};

class OniFileRecorder : public FileRecorder {
 public:
  OniFileRecorder(LiveSensor& sensor, const fs::path& file, bool jpeg)
      : recorder_(sensor, file, {.jpeg = jpeg}) {}
  Summary Finish() override {
    const OniFileSummary summary = recorder_.Finish();
    return {summary.color_us.size(), summary.depth_us.size()};
  }

 private:
  OniRecorder recorder_;
};

class OniKind : public RecordingKind {
 public:
  [[nodiscard]] std::string extension() const override { return ".oni"; }
  [[nodiscard]] std::vector<std::string> drivers() const override {
    return {"openni", "virtual-openni"};
  }
  [[nodiscard]] bool IsOne(const fs::path& file) const override { return IsOniFile(file); }
  [[nodiscard]] std::unique_ptr<FrameSource> Open(
      const fs::path& file, const RecordingDefaults& defaults) const override {
    return OpenOniRecording(file, defaults);
  }
  [[nodiscard]] std::vector<double> DepthStamps(const fs::path& file) const override {
    const std::optional<OniFileSummary> summary = SummariseOniFile(file);
    if (!summary)
      throw DataError(
          fmt::format("recording {} is not whole: it has no END record", file.string()));
    std::vector<double> stamps_s;
    for (const std::int64_t stamp_us : summary->depth_us)
      stamps_s.push_back(1e-6 * static_cast<double>(stamp_us));
    return stamps_s;
  }
  [[nodiscard]] std::unique_ptr<FileRecorder> Record(LiveSensor& sensor, const fs::path& file,
                                                     bool jpeg) const override {
    return std::make_unique<OniFileRecorder>(sensor, file, jpeg);
  }
  [[nodiscard]] fs::path SideCar(const fs::path& file) const override { return OniSideCar(file); }
  void Write(const fs::path& file, FrameSource& source, const std::stop_token& stop,
             const std::function<void()>& each) const override {
    WriteOni(file, source, stop, each);
  }
};

}  // namespace

void AddVirtualOpenNiDriver(SensorRegistry& registry) {
  registry.Add({.name = "virtual-openni",
                .title = "virtual sensor through OpenNI2",
                .is_simulated = true,
                .set_up = [](const SensorSettings& settings, const SimulatedSweeps& sweeps,
                             const std::stop_token& stop, const SetUpProgress& progress) {
                  return std::make_unique<VirtualOpenNiSetup>(settings, sweeps, stop, progress);
                }});
  registry.Add(std::make_unique<OniKind>());
}

}  // namespace plumb
