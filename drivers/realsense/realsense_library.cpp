// SPDX-License-Identifier: Apache-2.0
#include "drivers/realsense/realsense_library.hpp"

#include <dlfcn.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <system_error>

#include <fmt/format.h>

#include "algo/base/utf8.hpp"
#include "words/realsense.hpp"

namespace plumb::realsense {
namespace {

namespace fs = std::filesystem;

// The library counts major * 10000 + minor * 100 + patch.
constexpr int kMajor = 2;
constexpr int kLeastMinor = 36;
constexpr std::string_view kPrefix = "librealsense2.so.2.";

/// The numbers of "librealsense2.so.2.56.5" after the prefix; none if the name is of another form.
std::vector<int> VersionIn(const std::string& name) {
  if (!name.starts_with(kPrefix)) return {};
  std::vector<int> numbers = {0};
  for (const char c : name.substr(kPrefix.size())) {
    if (c == '.')
      numbers.push_back(0);
    else if (std::isdigit(static_cast<unsigned char>(c)) == 0 || numbers.back() > 10000)
      return {};
    else
      numbers.back() = 10 * numbers.back() + (c - '0');
  }
  return numbers;
}

}  // namespace

std::vector<fs::path> RealSenseLibrary::LibraryFolders() {
  return {"/usr/local/lib", fs::path("/usr/local/lib") / PLUMB_MULTIARCH, "/usr/lib",
          fs::path("/usr/lib") / PLUMB_MULTIARCH};
}

fs::path RealSenseLibrary::FindIn(const std::vector<fs::path>& folders) {
  fs::path newest;
  std::vector<int> newest_version;
  for (const fs::path& folder : folders) {
    std::error_code error;
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
         entry.increment(error)) {
      const std::vector<int> version = VersionIn(entry->path().filename().string());
      if (version <= newest_version) continue;
      newest_version = version;
      newest = entry->path();
    }
  }
  return newest;
}

std::string RealSenseLibrary::version() const {
  return fmt::format("{}.{}.{}", api_version_ / 10000, api_version_ / 100 % 100,
                     api_version_ % 100);
}

void RealSenseLibrary::Resolve(void* handle) {
#define PLUMB_RS_RESOLVE(result, name, parameters)                        \
  name = reinterpret_cast<decltype(name)>(::dlsym(handle, "rs2_" #name)); \
  if (name == nullptr) throw DeviceError(say::realsense::Function(file_, "rs2_" #name));
  PLUMB_RS_FUNCTIONS(PLUMB_RS_RESOLVE)
#undef PLUMB_RS_RESOLVE
}

std::shared_ptr<const RealSenseLibrary> RealSenseLibrary::Load(const fs::path& file) {
  const fs::path wanted = file.empty() ? FindIn(LibraryFolders()) : file;
  if (wanted.empty()) throw DeviceError(say::realsense::NotInstalled());
  void* handle = ::dlopen(wanted.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) throw DeviceError(say::realsense::NotLoaded(ValidUtf8(::dlerror())));
  std::shared_ptr<RealSenseLibrary> library(new RealSenseLibrary);
  library->file_ = wanted.string();
  library->Resolve(handle);
  library->api_version_ =
      library->Call(say::realsense::NoVersion(library->file_), library->get_api_version);
  const int version = library->api_version_;
  if (version / 10000 != kMajor || version / 100 % 100 < kLeastMinor)
    throw DeviceError(say::realsense::Version(library->file_, library->version()));
  return library;
}

void RealSenseLibrary::Check(const Message& what, Error* error) const {
  if (error == nullptr) return;
  const char* message = get_error_message(error);
  std::string why = ValidUtf8(message == nullptr ? "" : message);
  free_error(error);
  throw DeviceError(say::realsense::Failed(what, std::move(why)));
}

}  // namespace plumb::realsense
