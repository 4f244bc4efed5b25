// SPDX-License-Identifier: Apache-2.0
#include "tests/devices/openni_driver/virtual_sensor.hpp"

#include <exception>

namespace plumb {

VirtualSensor::VirtualSensor(const VirtualSensorOptions& options, const std::stop_token& stop,
                             const SetUpProgress& progress)
    : runtime_library_(options.runtime.empty() ? FindVirtualSensorRuntime() : options.runtime) {
  const RenderedScenes rendered = RenderScenes(options, stop, progress);
  session_ = std::make_unique<VirtualSession>(VirtualSession::Contents{
      options.serial, options.plugged, rendered.caches, rendered.camera_file});
}

VirtualSensor::~VirtualSensor() = default;

void VirtualSensor::Quit() const noexcept {
  try {
    (void)Command("quit");
  } catch (const std::exception&) {
    // It is not listening any more.
  }
}

}  // namespace plumb
