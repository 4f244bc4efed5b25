// SPDX-License-Identifier: Apache-2.0
#include "drivers/openni/openni_driver.hpp"
#include "words/sensor.hpp"

#include <dlfcn.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <system_error>

namespace plumb {
namespace {

namespace fs = std::filesystem;

struct Known {
  std::string_view name;  // of the file, between "lib" and ".so"
  Message (*serves)();
  bool is_debians;
};
constexpr std::array kKnown{Known{"PS1080", say::sensor::ServesXtion, true},
                            Known{"PSLink", say::sensor::ServesPslink, true},
                            Known{"OniFile", say::sensor::ServesOniFiles, true},
                            Known{"DummyDevice", say::sensor::ServesNothing, true},
                            Known{"orbbec", say::sensor::ServesOrbbec, false},
                            Known{"FreenectDriver", say::sensor::ServesKinect, false},
                            Known{"freenect2-openni2", say::sensor::ServesKinect2, false}};

constexpr std::string_view kEnding = ".so.0";

/// "PS1080" of "libPS1080.so.0"; empty if it is not the name of a library.
std::string NameOf(const std::string& file) {
  const std::size_t end = file.find(".so");
  return file.starts_with("lib") && end != std::string::npos ? file.substr(3, end - 3) : "";
}

Message WhyNotUsed(const fs::path& file) {
  if (!file.string().ends_with(kEnding)) {
    return say::sensor::DriverFileName(kEnding, file.filename().string(),
                                       NameOf(file.filename().string()));
  }
  void* handle = ::dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) {
    const char* why = ::dlerror();
    return why == nullptr ? say::sensor::DriverFileNotLoaded()
                          : say::sensor::DriverFileUnloadable(why);
  }
  // It stays loaded, as OpenNI2 would leave it: drivers do not survive being unloaded.
  if (::dlsym(handle, "oniDriverCreate") == nullptr) return say::sensor::NotADriver();
  return {};
}

}  // namespace

std::optional<fs::path> OpenNiDriverFolder() {
  void* handle = ::dlopen("libOpenNI2.so.0", RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) return std::nullopt;
  Dl_info info{};
  void* function = ::dlsym(handle, "oniInitialize");
  if (function == nullptr || ::dladdr(function, &info) == 0) return std::nullopt;
  return fs::path(info.dli_fname).parent_path() / "OpenNI2" / "Drivers";
}

std::vector<OpenNiDriverFile> FindOpenNiDrivers(const fs::path& folder) {
  std::vector<OpenNiDriverFile> drivers;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    const fs::path& file = entry->path();
    const std::string name = NameOf(file.filename().string());
    if (name.empty()) continue;
    if (file.extension() == ".so" && fs::exists(fs::path(file.string() + ".0"))) continue;
    const auto known = std::find_if(kKnown.begin(), kKnown.end(),
                                    [&](const Known& one) { return one.name == name; });
    drivers.push_back(
        {.file = file,
         .serves = known == kKnown.end() ? say::sensor::ServesUnknown() : known->serves(),
         .is_debians = known != kKnown.end() && known->is_debians,
         .problem = WhyNotUsed(file)});
  }
  std::sort(drivers.begin(), drivers.end(),
            [](const auto& a, const auto& b) { return a.file < b.file; });
  return drivers;
}

}  // namespace plumb
