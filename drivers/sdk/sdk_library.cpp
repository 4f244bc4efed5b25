// SPDX-License-Identifier: Apache-2.0
#include "drivers/sdk/sdk_library.hpp"

#include <dlfcn.h>

#include <system_error>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/base/utf8.hpp"
#include "drivers/sdk/version_numbers.hpp"
#include "words/sdk.hpp"

namespace plumb {

namespace fs = std::filesystem;

std::vector<fs::path> SdkLibrary::Folders() {
  return {"/usr/local/lib", fs::path("/usr/local/lib") / PLUMB_MULTIARCH, "/usr/lib",
          fs::path("/usr/lib") / PLUMB_MULTIARCH};
}

fs::path SdkLibrary::FindIn(const std::string& prefix, const std::vector<fs::path>& folders) {
  fs::path newest;
  VersionNumbers newest_version{};
  for (const fs::path& folder : folders) {
    std::error_code error;
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
         entry.increment(error)) {
      const std::string name = entry->path().filename().string();
      if (!name.starts_with(prefix)) continue;
      const auto version = StrictVersionNumbers(name.substr(prefix.size()));
      if (!version || *version <= newest_version) continue;
      newest_version = *version;
      newest = entry->path();
    }
  }
  return newest;
}

SdkLibrary::SdkLibrary(SdkTitle title, const fs::path& file) : title_(std::move(title)) {
  const fs::path wanted = file.empty() ? FindIn(title_.prefix, Folders()) : file;
  if (wanted.empty())
    throw DeviceError(say::sdk::NotInstalled(title_.name, title_.prefix + "*", title_.guide));
  file_ = wanted.string();
  handle_ = ::dlopen(file_.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle_ == nullptr)
    throw DeviceError(say::sdk::NotLoaded(title_.name, ValidUtf8(::dlerror()), title_.guide));
}

void* SdkLibrary::Function(const char* name) const {
  void* found = ::dlsym(handle_, name);
  if (found == nullptr)
    throw DeviceError(say::sdk::Function(file_, name, title_.name, title_.least));
  return found;
}

void SdkLibrary::SetVersion(const std::string& version) {
  version_ = version;
  const VersionNumbers found = VersionNumbersIn(version), least = VersionNumbersIn(title_.least);
  if (found[0] != least[0] || found < least)
    throw DeviceError(say::sdk::Version(file_, version, title_.name, title_.least));
}

void ThrowSdkFailure(const Message& what, std::string reason) {
  throw DeviceError(say::sdk::Failed(what, std::move(reason)));
}

}  // namespace plumb
