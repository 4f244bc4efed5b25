// SPDX-License-Identifier: Apache-2.0
#include "drivers/freenect/freenect_library.hpp"

#include <string>
#include <string_view>

#include "drivers/sdk/version_numbers.hpp"

namespace plumb::freenect {

const SdkTitle& FreenectTitle() {
  static const SdkTitle title{.name = "libfreenect",
                              .prefix = "libfreenect.so.0.",
                              .least = "0.5",
                              .guide = "docs/freenect.md",
                              .states_camera = false};
  return title;
}

FreenectLibrary::FreenectLibrary(const std::filesystem::path& wanted)
    : SdkLibrary(FreenectTitle(), wanted) {
#define PLUMB_FREENECT_RESOLVE(result, name, parameters) \
  name = reinterpret_cast<decltype(name)>(Function("freenect_" #name));
  PLUMB_FREENECT_FUNCTIONS(PLUMB_FREENECT_RESOLVE)
#undef PLUMB_FREENECT_RESOLVE
  // It states its version in the name of its file only; links of other names are taken as they are.
  const std::string name = std::filesystem::path(file()).filename().string();
  constexpr std::string_view kStem = "libfreenect.so.";
  const std::string version = name.starts_with(kStem) ? name.substr(kStem.size()) : "";
  SetVersion(StrictVersionNumbers(version) ? version : FreenectTitle().least);
}

}  // namespace plumb::freenect
