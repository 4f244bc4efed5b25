// SPDX-License-Identifier: Apache-2.0
#include "drivers/stream/stream_driver.hpp"

#include <filesystem>
#include <memory>
#include <optional>
#include <utility>

#include "algo/base/errors.hpp"
#include "drivers/live/boxed_sensor.hpp"
#include "drivers/live/sensor_calibration.hpp"
#include "drivers/stream/feeder_server.hpp"
#include "words/sensor.hpp"

namespace plumb {
namespace {

using stream::Feeder;
using stream::FeederServer;

/// Less than half a period, so that an image has one partner.
std::chrono::microseconds LargestGapOf(double rate_hz) {
  return std::chrono::microseconds(static_cast<std::int64_t>(0.49e6 / rate_hz));
}

/// The unit's own file states the colour camera instead of the feeder; what the feeder states of
/// its depth camera holds where the file does not state it.
StreamInfo InfoOf(const SensorSettings& settings, const Feeder& feeder) {
  const std::string& serial = feeder.description.serial;
  const CameraFile& fed = feeder.hello.camera;
  const Intrinsics& color = fed.color;
  std::error_code error;
  if (std::filesystem::exists(CalibrationFile(settings.calibration_folder, serial), error)) {
    StreamInfo stated;
    TakeOver(fed, stated);
    return LiveStreamInfo(
        settings, serial, color.width, color.height, 0.0,
        {.sensor = stated.depth_sensor, .noise = stated.depth_noise, .range = stated.usable_depth});
  }
  nlohmann::json camera = feeder.hello.camera_keys;
  camera.erase("depth_registered");  // Depth is registered here, whatever its camera.
  for (const char* key : kDepthCameraKeys) camera.erase(key);
  return CalibratedStreamInfo(settings, camera.dump(), "camera", serial, color.width, color.height);
}

class StreamSensor : public BoxedSensor {
 public:
  StreamSensor(const SensorSettings& settings, const Feeder& feeder, std::shared_ptr<FrameBox> box,
               std::shared_ptr<FeederServer> server)
      : BoxedSensor(feeder.description, std::move(box)), server_(std::move(server)) {
    SetInfo(InfoOf(settings, feeder));
    std::optional<DepthRegistration> registration;
    if (const std::optional<DepthCamera>& depth = feeder.hello.camera.depth_camera)
      registration.emplace(depth->intrinsics, info().intrinsics, depth->T_color_depth);
    SetDepth(feeder.hello.camera.depth_scale.value(), std::move(registration));
  }
  void LockExposure(bool locked) override { server_->Tell({{"lock_exposure", locked}}); }

 private:
  const std::shared_ptr<FeederServer> server_;
};

class StreamProvider : public SensorProvider {
 public:
  explicit StreamProvider(SensorSettings settings)
      : settings_(std::move(settings)),
        server_(std::make_shared<FeederServer>(settings_.stream_socket)) {}
  ~StreamProvider() override { server_->events().SetListener({}); }

  [[nodiscard]] std::vector<SensorDescription> List() override {
    const std::optional<Feeder> feeder = server_->feeder();
    if (!feeder) return {};
    return {feeder->description};
  }
  void SetListener(std::function<void()> changed) override {
    server_->events().SetListener(std::move(changed));
  }
  [[nodiscard]] std::unique_ptr<LiveSensor> Open(const std::string& serial) override {
    const std::optional<Feeder> feeder = server_->feeder();
    (void)ChooseSensor(feeder ? std::vector{feeder->description} : std::vector<SensorDescription>(),
                       serial);
    const auto box = std::make_shared<FrameBox>(
        feeder->description.serial, LargestGapOf(feeder->hello.rate_hz), stream::kPatience);
    auto sensor = std::make_unique<StreamSensor>(settings_, *feeder, box, server_);
    box->Begin(0);
    if (!server_->Deliver(feeder->description.uri, box))
      throw DeviceError(say::sensor::UnpluggedWhileOpened(feeder->description.serial));
    return sensor;
  }

 private:
  const SensorSettings settings_;
  const std::shared_ptr<FeederServer> server_;
};

class StreamSetup : public SensorSetup {
 public:
  explicit StreamSetup(SensorSettings settings) : settings_(std::move(settings)) {}
  [[nodiscard]] std::unique_ptr<SensorProvider> MakeProvider() const override {
    return std::make_unique<StreamProvider>(settings_);
  }

 private:
  const SensorSettings settings_;
};

}  // namespace

void AddStreamDriver(SensorRegistry& registry) {
  registry.Add(
      {.name = "stream",
       .title = "stream",
       .is_simulated = false,
       .states_camera = true,
       .set_up = [](const SensorSettings& settings, const SimulatedSweeps&, const std::stop_token&,
                    const SetUpProgress&) { return std::make_unique<StreamSetup>(settings); }});
}

}  // namespace plumb
