// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/openni/oni_recordings.hpp"

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "algo/base/errors.hpp"
#include "drivers/openni/oni_file.hpp"
#include "drivers/openni/oni_recorder.hpp"
#include "drivers/openni/oni_recording.hpp"
#include "drivers/simulator/openni/oni_writer.hpp"
#include "words/recording.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

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
  [[nodiscard]] std::vector<std::string> drivers() const override { return {"openni"}; }
  [[nodiscard]] bool IsOne(const fs::path& file) const override { return IsOniFile(file); }
  [[nodiscard]] std::unique_ptr<FrameSource> Open(
      const fs::path& file, const RecordingDefaults& defaults) const override {
    return OpenOniRecording(file, defaults);
  }
  [[nodiscard]] std::vector<double> DepthStamps(const fs::path& file) const override {
    const std::optional<OniFileSummary> summary = SummariseOniFile(file);
    if (!summary) throw DataError(say::recording::OniNotWhole(file.string()));
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
             const std::function<void()>& each, bool jpeg) const override {
    WriteOni(file, source, stop, each, jpeg);
  }
};

}  // namespace

void AddOniRecordings(SensorRegistry& registry) { registry.Add(std::make_unique<OniKind>()); }

}  // namespace plumb
