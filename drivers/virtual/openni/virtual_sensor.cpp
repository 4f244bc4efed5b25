#include "drivers/virtual/openni/virtual_sensor.hpp"

#include <optional>

#include "algo/base/errors.hpp"
#include "drivers/program_folders.hpp"

namespace plumb {

namespace fs = std::filesystem;

fs::path FindVirtualSensorRuntime() {
  const std::optional<fs::path> found =
      FindBesideProgram("lib/plumb/virtual-sensor/libOpenNI2.so.0");
  if (!found)
    throw IoError(
        "the virtual sensor's driver is missing: expected lib/plumb/virtual-sensor/libOpenNI2.so.0 "
        "in a folder above this program; build the target plumb_virtual_sensor or install the "
        "component virtual_sensor");
  return *found;
}

VirtualSensor::VirtualSensor(const VirtualSensorOptions& options, const std::stop_token& stop,
                             const SetUpProgress& progress)
    : runtime_library_(options.runtime.empty() ? FindVirtualSensorRuntime() : options.runtime) {
  const RenderedScenes rendered = RenderScenes(options, stop, progress);
  session_ = std::make_unique<VirtualSession>(
      VirtualSession::Contents{options.serial, options.plugged, rendered.caches, rendered.camera});
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
