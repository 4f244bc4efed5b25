// SPDX-License-Identifier: Apache-2.0
#include "drivers/openni/oni_recorder.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <chrono>
#include <stdexcept>
#include <thread>
#include <utility>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/live/sensor_calibration.hpp"
#include "drivers/openni/openni_library.hpp"
#include "drivers/openni/openni_sensor.hpp"
#include "drivers/replay/tum_writer.hpp"
#include "words/recording.hpp"

namespace plumb {
namespace {

constexpr std::chrono::seconds kStartTime{
    20};  // OpenNI2 starts on its own thread, mostly within 1 ms
constexpr std::chrono::milliseconds kPoll{1};

}  // namespace

struct OniRecorder::Impl {
  OpenNiSensor* sensor = nullptr;
  std::shared_ptr<const OpenNiLibrary> library;
  std::filesystem::path file;
  std::string side_car;
  OniRecorderHandle recorder = nullptr;
  bool finished = false;

  void Stop() noexcept {
    if (recorder == nullptr) return;
    library->RecorderStop(recorder);
    library->RecorderDestroy(&recorder);
    recorder = nullptr;
  }
  ~Impl() {
    Stop();
    if (sensor != nullptr) sensor->box().KeepStamps(false);
    std::error_code ignored;
    if (!finished) std::filesystem::remove(file, ignored);
  }
};

OniRecorder::OniRecorder(LiveSensor& sensor, std::filesystem::path file, const Options& options)
    : impl_(std::make_unique<Impl>()) {
  auto* openni = dynamic_cast<OpenNiSensor*>(&sensor);
  if (openni == nullptr)
    throw std::invalid_argument("only sensors of OpenNI2 can be recorded as .oni");
  impl_->sensor = openni;
  impl_->library = openni->streams().library;
  impl_->file = std::move(file);
  impl_->side_car = CameraFileText(sensor.info(), 1000.0) +
                    fmt::format("sensor_serial: \"{}\"\n",
                                CalibrationFile({}, sensor.description().serial).stem().string());
  // reports the cause, where OpenNI2 would only fail
  WriteWholeFile(impl_->file, std::string_view());
  const OpenNiLibrary& library = *impl_->library;
  openni->box().KeepStamps(true);
  const Message what = say::recording::CannotRecord(impl_->file.string());
  library.Check(what, library.CreateRecorder(impl_->file.c_str(), &impl_->recorder));
  library.Check(what,
                library.RecorderAttachStream(impl_->recorder, openni->streams().depth, FALSE));
  library.Check(what, library.RecorderAttachStream(impl_->recorder, openni->streams().color,
                                                   options.jpeg ? TRUE : FALSE));
  library.Check(what, library.RecorderStart(impl_->recorder));
  const auto limit = std::chrono::steady_clock::now() + kStartTime;
  while (!HasOniDataBegun(impl_->file, 2)) {
    if (std::chrono::steady_clock::now() > limit)
      throw DeviceError(say::recording::OniNotBegun(what, kStartTime.count()));
    std::this_thread::sleep_for(kPoll);
  }
}

OniRecorder::~OniRecorder() = default;

OniFileSummary OniRecorder::Finish(const std::optional<OniBegin>& begin) {
  impl_->Stop();
  OniFileSummary summary = TrimOniFile(impl_->file);
  const FrameBox& box = impl_->sensor->box();
  const std::optional<std::int64_t> color_us =
      begin ? begin->color_us : FindOniBegin(summary.color_us, box.StampsOf(StreamKind::kColor));
  const std::optional<std::int64_t> depth_us =
      begin ? begin->depth_us : FindOniBegin(summary.depth_us, box.StampsOf(StreamKind::kDepth));
  if (!color_us || !depth_us) {
    throw IoError(say::recording::OniOtherStamps(impl_->file.string(), summary.color_us.size(),
                                                 summary.depth_us.size()));
  }
  WriteWholeFile(OniSideCar(impl_->file), impl_->side_car + OniBeginText({*color_us, *depth_us}));
  impl_->finished = true;
  return summary;
}

}  // namespace plumb
