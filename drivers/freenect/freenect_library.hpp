// SPDX-License-Identifier: Apache-2.0
// libfreenect, loaded at run time through its C interface.
#pragma once

#include <filesystem>

#include "drivers/freenect/freenect_api.hpp"
#include "drivers/sdk/sdk_library.hpp"

namespace plumb::freenect {

[[nodiscard]] const SdkTitle& FreenectTitle();

class FreenectLibrary : public SdkLibrary {
 public:
  /// @throws DeviceError if there is none, or it cannot be loaded.
  explicit FreenectLibrary(const std::filesystem::path& file);

#define PLUMB_FREENECT_DECLARE(result, name, parameters) result(*name) parameters = nullptr;
  PLUMB_FREENECT_FUNCTIONS(PLUMB_FREENECT_DECLARE)
#undef PLUMB_FREENECT_DECLARE
};

}  // namespace plumb::freenect
