// SPDX-License-Identifier: Apache-2.0
#include "drivers/freenect/freenect_driver.hpp"

#include <memory>

#include "drivers/freenect/freenect_host.hpp"

namespace plumb {

void AddFreenectDriver(SensorRegistry& registry) {
  AddSdkDriver(registry, "freenect", freenect::FreenectTitle(), [](const SensorSettings& settings) {
    return std::make_shared<freenect::FreenectHost>(settings);
  });
}

}  // namespace plumb
