// SPDX-License-Identifier: Apache-2.0
#include "drivers/orbbec/orbbec_library.hpp"

#include <system_error>

#include <fmt/format.h>

#include "algo/base/utf8.hpp"

namespace plumb::orbbec {

const SdkTitle& OrbbecTitle() {
  static const SdkTitle title{.name = "OrbbecSDK",
                              .prefix = "libOrbbecSDK.so.2.",
                              .least = "2.0",
                              .guide = "docs/orbbec.md"};
  return title;
}

OrbbecLibrary::OrbbecLibrary(const std::filesystem::path& wanted)
    : SdkCalls(OrbbecTitle(), wanted) {
#define PLUMB_OB_RESOLVE(result, name, parameters) \
  name = reinterpret_cast<decltype(name)>(Function("ob_" #name));
  PLUMB_OB_FUNCTIONS(PLUMB_OB_RESOLVE)
#undef PLUMB_OB_RESOLVE
  // The library counts major * 10000 + minor * 100 + patch.
  const int version = get_version();
  SetVersion(fmt::format("{}.{}.{}", version / 10000, version / 100 % 100, version % 100));
  // It would write a folder of logs to wherever it runs.
  (void)Try(set_logger_to_file, kLogOff, "");
  (void)Try(set_logger_to_console, kLogOff);
  // What it needs for time of flight lies beside it, and it looks where it runs.
  const std::filesystem::path extensions =
      std::filesystem::path(file()).parent_path() / "extensions";
  std::error_code error;
  if (std::filesystem::is_directory(extensions, error))
    (void)Try(set_extensions_directory, extensions.c_str());
}

std::string OrbbecLibrary::TakeReason(Error* error) const {
  const char* message = error_get_message(error);
  std::string why = ValidUtf8(message == nullptr ? "" : message);
  delete_error(&error);
  return why;
}

}  // namespace plumb::orbbec
