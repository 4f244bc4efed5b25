// SPDX-License-Identifier: Apache-2.0
#include "drivers/realsense/realsense_library.hpp"

#include <fmt/format.h>

#include "algo/base/utf8.hpp"
#include "words/sdk.hpp"

namespace plumb::realsense {

const SdkTitle& RealSenseTitle() {
  static const SdkTitle title{.name = "librealsense2",
                              .prefix = "librealsense2.so.2.",
                              .least = "2.36",
                              .guide = "docs/realsense.md"};
  return title;
}

RealSenseLibrary::RealSenseLibrary(const std::filesystem::path& file)
    : SdkCalls(RealSenseTitle(), file) {
#define PLUMB_RS_RESOLVE(result, name, parameters) \
  name = reinterpret_cast<decltype(name)>(Function("rs2_" #name));
  PLUMB_RS_FUNCTIONS(PLUMB_RS_RESOLVE)
#undef PLUMB_RS_RESOLVE
  // The library counts major * 10000 + minor * 100 + patch.
  api_version_ = Call(say::sdk::NoVersion(this->file()), get_api_version);
  SetVersion(
      fmt::format("{}.{}.{}", api_version_ / 10000, api_version_ / 100 % 100, api_version_ % 100));
}

std::string RealSenseLibrary::TakeReason(Error* error) const {
  const char* message = get_error_message(error);
  std::string why = ValidUtf8(message == nullptr ? "" : message);
  free_error(error);
  return why;
}

}  // namespace plumb::realsense
