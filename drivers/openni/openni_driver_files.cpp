#include "drivers/openni/openni_driver.hpp"

#include <dlfcn.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <system_error>

#include <fmt/format.h>

namespace plumb {
namespace {

namespace fs = std::filesystem;

struct Known {
  std::string_view name;  // of the file, between "lib" and ".so"
  std::string_view serves;
  bool is_debians;
};
constexpr std::array kKnown{
    Known{"PS1080", "Xtion, Carmine and relatives (1d27:0500 to 0609)", true},
    Known{"PSLink", "PSLink sensors (1d27:1250 to 1280)", true},
    Known{"OniFile", ".oni files", true},
    Known{"DummyDevice", "no sensor, an example", true},
    Known{"orbbec", "sensors of Orbbec (2bc5:*), from its OpenNI2 package", false},
    Known{"FreenectDriver", "Kinect for Xbox 360 (045e:02ae), from libfreenect", false},
    Known{"freenect2-openni2", "Kinect 2 (045e:02c4, 02d8), from libfreenect2", false}};

constexpr std::string_view kEnding = ".so.0";

/// "PS1080" of "libPS1080.so.0"; empty if it is not the name of a library.
std::string NameOf(const std::string& file) {
  const std::size_t end = file.find(".so");
  return file.starts_with("lib") && end != std::string::npos ? file.substr(3, end - 3) : "";
}

std::string WhyNotUsed(const fs::path& file) {
  if (!file.string().ends_with(kEnding)) {
    return fmt::format(
        "Debian's OpenNI2 uses names that end in {0} only: ln -s {1} lib{2}{0} in that folder",
        kEnding, file.filename().string(), NameOf(file.filename().string()));
  }
  void* handle = ::dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) {
    const char* why = ::dlerror();
    return fmt::format(
        "it cannot be loaded: {}; install the libraries it depends on, for this architecture",
        why == nullptr ? "no reason given" : why);
  }
  // It stays loaded, as OpenNI2 would leave it: drivers do not survive being unloaded.
  if (::dlsym(handle, "oniDriverCreate") == nullptr)
    return "not an OpenNI 2 driver (no oniDriverCreate): remove it";
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
         .serves = std::string(known == kKnown.end() ? "sensors that Plumb does not know"
                                                     : known->serves),
         .is_debians = known != kKnown.end() && known->is_debians,
         .problem = WhyNotUsed(file)});
  }
  std::sort(drivers.begin(), drivers.end(),
            [](const auto& a, const auto& b) { return a.file < b.file; });
  return drivers;
}

}  // namespace plumb
