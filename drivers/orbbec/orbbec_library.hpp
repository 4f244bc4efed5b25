// SPDX-License-Identifier: Apache-2.0
// OrbbecSDK 2, loaded at run time through its C interface.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "drivers/orbbec/orbbec_api.hpp"
#include "drivers/sdk/sdk_library.hpp"

namespace plumb::orbbec {

[[nodiscard]] const SdkTitle& OrbbecTitle();

class OrbbecLibrary : public SdkCalls<OrbbecLibrary, Error> {
 public:
  /// @throws DeviceError if there is none, it cannot be loaded, or it is of another version.
  explicit OrbbecLibrary(const std::filesystem::path& file);

  [[nodiscard]] std::string TakeReason(Error* error) const;
  /// Owns one of the library's objects, which this function deletes.
  template <typename Object, typename Delete>
  [[nodiscard]] std::shared_ptr<Object> Own(Object* object, Delete remove) const {
    return {object, [this, remove](Object* given) {
              if (given != nullptr) (void)Try(remove, given);
            }};
  }

#define PLUMB_OB_DECLARE(result, name, parameters) result(*name) parameters = nullptr;
  PLUMB_OB_FUNCTIONS(PLUMB_OB_DECLARE)
#undef PLUMB_OB_DECLARE
};

}  // namespace plumb::orbbec
