// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/player/virtual_provider.hpp"

#include <unistd.h>

#include <algorithm>
#include <string>
#include <utility>

#include "algo/base/errors.hpp"
#include "drivers/live/boxed_sensor.hpp"
#include "drivers/live/sensor_calibration.hpp"
#include "drivers/simulator/player/sweep_player.hpp"
#include "drivers/simulator/player/virtual_scenes.hpp"
#include "words/sensor.hpp"

namespace plumb {
namespace {

using simulated::PlayedPair;
using simulated::Stage;
using simulated::Unit;
using simulated::VirtualBus;

constexpr std::chrono::microseconds kMaxGap{16000};  // between the stamps of a pair
constexpr double kNominalFov_rad = 1.0226;           // as stated by the plug-in of OpenNI2

std::vector<std::string> Texts(const std::vector<std::filesystem::path>& paths) {
  std::vector<std::string> texts;
  for (const std::filesystem::path& path : paths) texts.push_back(path.string());
  return texts;
}

/// One open unit.
class VirtualLiveSensor : public BoxedSensor {
 public:
  VirtualLiveSensor(const SensorDescription& description, const std::shared_ptr<Unit>& unit,
                    const VirtualUnits& units, std::shared_ptr<FrameBox> box)
      : BoxedSensor(description, std::move(box)), shape_(units.bus->stage()->shape()) {
    const int width = static_cast<int>(shape_.width), height = static_cast<int>(shape_.height);
    const auto own = units.calibrations.find(unit->serial);
    SetInfo(own != units.calibrations.end()
                ? CalibratedStreamInfo(units.settings, own->second, unit->serial + ".yaml",
                                       unit->serial, width, height)
                : LiveStreamInfo(units.settings, unit->serial, width, height, kNominalFov_rad));
    this->box().Begin(0);
    player_ = std::make_unique<simulated::SweepPlayer>(
        unit, units.bus->stage(), [] { return true; },
        [this](const PlayedPair& pair) { Accept(pair); });
  }

  void LockExposure(bool) override {}  // the simulated camera has a fixed exposure

 private:
  void Accept(const PlayedPair& pair) {
    const int width = static_cast<int>(shape_.width), height = static_cast<int>(shape_.height);
    for (const StreamKind kind : {StreamKind::kDepth, StreamKind::kColor}) {
      const bool is_depth = kind == StreamKind::kDepth;
      if (pair.depth_only && !is_depth) continue;
      box().CountGaps(kind, pair.frame_index);
      if (pair.small) {
        box().CountDiscarded();
        continue;
      }
      cv::Mat image(height, width, is_depth ? CV_16UC1 : CV_8UC3);
      if (is_depth)
        std::copy(pair.depth_mm.begin(), pair.depth_mm.end(), image.ptr<std::uint16_t>());
      else
        std::copy(pair.rgb.begin(), pair.rgb.end(), image.ptr<std::uint8_t>());
      box().Add(kind, is_depth ? pair.stamps.depth_us : pair.stamps.color_us, std::move(image));
    }
  }

  const simulated::FrameCacheShape shape_;
  /// Last member: its thread ends before the box is destroyed.
  std::unique_ptr<simulated::SweepPlayer> player_;
};

/// The rendered scenes and the plugged-in units, for one run of a program.
class VirtualSetup : public SensorSetup {
 public:
  VirtualSetup(SensorSettings settings, const VirtualSensorOptions& options,
               const std::stop_token& stop, const SetUpProgress& progress) {
    const RenderedScenes scenes = RenderScenes(options, stop, progress);
    settings.calibration_folder.clear();  // it belongs to real sensors
    settings.markers_are_the_rooms = false;
    const auto stage = std::make_shared<Stage>(Texts(scenes.caches), Texts(scenes.at_rest),
                                               Texts(scenes.second_at_rest));
    const std::string& second = options.second_serial;
    units_ = {.bus = std::make_shared<VirtualBus>(stage, options.serial, second),
              .settings = std::move(settings),
              .calibrations = {{options.serial, scenes.camera_file}}};
    if (options.plugged) (void)Command("plug");
    if (scenes.second_at_rest.empty()) return;
    units_.calibrations[second] = scenes.second_camera_file;
    (void)Command("plug " + second);
  }

  [[nodiscard]] std::unique_ptr<SensorProvider> MakeProvider() const override {
    return std::make_unique<VirtualProvider>(units_);
  }
  void BeforeScan() const override { (void)Command("rewind"); }
  std::string Command(const std::string& command) const override {
    return AcceptedAnswer(command, units_.bus->Obey(command));
  }

 private:
  VirtualUnits units_;
};

}  // namespace

VirtualProvider::VirtualProvider(VirtualUnits units)
    : units_(std::move(units)), events_(std::make_shared<SensorEvents>()) {
  units_.bus->SetListener([events = events_](const Unit& unit, VirtualBus::Event event) {
    if (event == VirtualBus::Event::kUnplugged) events->Lose(unit.uri);
    if (event == VirtualBus::Event::kFailed || event == VirtualBus::Event::kWorksAgain)
      events->SetFailed(unit.uri, event == VirtualBus::Event::kFailed);
    events->Notify();
  });
}

VirtualProvider::~VirtualProvider() {
  SetListener({});
  while (units_.bus->hangs()) ::pause();
}

std::vector<SensorDescription> VirtualProvider::List() {
  std::vector<SensorDescription> sensors;
  for (const auto& unit : units_.bus->units())
    sensors.push_back({unit->uri, unit->serial, "Plumb Virtual Xtion", simulated::kVirtualUsbVendor,
                       simulated::kVirtualUsbProduct});
  std::sort(sensors.begin(), sensors.end(), [](const auto& a, const auto& b) {
    return std::tie(a.serial, a.uri) < std::tie(b.serial, b.uri);
  });
  return sensors;
}

void VirtualProvider::SetListener(std::function<void()> changed) {
  events_->SetListener(std::move(changed));
}

std::unique_ptr<LiveSensor> VirtualProvider::Open(const std::string& serial) {
  const std::vector<SensorDescription> sensors = List();
  const SensorDescription& found = ChooseSensor(sensors, serial);
  auto box = std::make_shared<FrameBox>(found.serial, kMaxGap, units_.stall_time);
  events_->Watch(found.uri, box);
  // The box is notified about unplugging from here on, so no event is missed between the listing
  // and the first image.
  const std::shared_ptr<Unit> unit = units_.bus->At(found.uri);
  if (!unit) throw DeviceLost(say::sensor::UnpluggedWhileOpened(found.serial));
  if (unit->failed) box->SetFailed(true);
  return std::make_unique<VirtualLiveSensor>(found, unit, units_, std::move(box));
}

void AddVirtualDriver(SensorRegistry& registry) {
  registry.Add({.name = "virtual",
                .title = "virtual sensor",
                .is_simulated = true,
                .set_up = [](const SensorSettings& settings, const SimulatedSweeps& sweeps,
                             const std::stop_token& stop, const SetUpProgress& progress) {
                  return std::make_unique<VirtualSetup>(settings, VirtualSensorOptions{sweeps},
                                                        stop, progress);
                }});
}

}  // namespace plumb
