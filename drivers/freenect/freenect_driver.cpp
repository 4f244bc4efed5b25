// SPDX-License-Identifier: Apache-2.0
#include "drivers/freenect/freenect_driver.hpp"

#include <memory>
#include <utility>

#include "drivers/freenect/freenect_host.hpp"
#include "drivers/freenect/freenect_sensor.hpp"

namespace plumb {

void AddFreenectDriver(SensorRegistry& registry) {
  AddSdkDriver(registry, "freenect", freenect::FreenectTitle(), [](const SensorSettings& settings) {
    return std::make_shared<freenect::FreenectHost>(
        settings, [](std::shared_ptr<freenect::FreenectHost> host, SdkOpening opening,
                     const SensorSettings& of_sensor) {
          return std::make_unique<freenect::FreenectSensor>(std::move(host), std::move(opening),
                                                            of_sensor);
        });
  });
}

}  // namespace plumb
