// SPDX-License-Identifier: Apache-2.0
// Whether emulated devices are possible in this run.
#pragma once

#include <cstdlib>
#include <string_view>

namespace plumb::testing {

/// True if umockdev stands between this process and the system, as ctest arranges it.
/// (umockdev_in_mock_environment() is valid only once there is a test bed, and making one without
/// it fails.)
[[nodiscard]] inline bool UnderUmockdev() {
  const char* preload = std::getenv("LD_PRELOAD");
  return preload != nullptr && std::string_view(preload).find("umockdev") != std::string_view::npos;
}

}  // namespace plumb::testing
