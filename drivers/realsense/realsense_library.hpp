// SPDX-License-Identifier: Apache-2.0
// librealsense2, loaded at run time through its C interface.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "drivers/realsense/realsense_api.hpp"
#include "drivers/sdk/sdk_library.hpp"

namespace plumb::realsense {

[[nodiscard]] const SdkTitle& RealSenseTitle();

class RealSenseLibrary : public SdkCalls<RealSenseLibrary, Error> {
 public:
  /// @throws DeviceError if there is none, it cannot be loaded, or it is of another version.
  explicit RealSenseLibrary(const std::filesystem::path& file);

  [[nodiscard]] int api_version() const { return api_version_; }
  [[nodiscard]] std::string TakeReason(Error* error) const;

#define PLUMB_RS_DECLARE(result, name, parameters) result(*name) parameters = nullptr;
  PLUMB_RS_FUNCTIONS(PLUMB_RS_DECLARE)
#undef PLUMB_RS_DECLARE

 private:
  int api_version_ = 0;
};

/// Owns one of the library's objects.
template <typename Object>
using Owned = std::unique_ptr<Object, void (*)(Object*)>;

}  // namespace plumb::realsense
