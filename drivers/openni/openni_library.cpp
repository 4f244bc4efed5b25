#include "drivers/openni/openni_library.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include "algo/base/errors.hpp"

namespace plumb {
namespace {

constexpr int kApiVersion = 2 * 1000 + 2;  // of the headers: major * 1000 + minor

const char* StatusName(OniStatus status) {
  switch (status) {
    case ONI_STATUS_OK:
      return "ok";
    case ONI_STATUS_NOT_IMPLEMENTED:
      return "not implemented";
    case ONI_STATUS_NOT_SUPPORTED:
      return "not supported";
    case ONI_STATUS_BAD_PARAMETER:
      return "bad parameter";
    case ONI_STATUS_OUT_OF_FLOW:
      return "not in this state";
    case ONI_STATUS_NO_DEVICE:
      return "no device";
    case ONI_STATUS_TIME_OUT:
      return "time out";
    case ONI_STATUS_ERROR:
      break;
  }
  return "error";
}

}  // namespace

// The library is never unloaded, because its drivers leave threads and static objects that do not
// survive it.
void OpenNiLibrary::Resolve(void* handle, const std::string& name) {
#define PLUMB_ONI_RESOLVE(function)                                                  \
  function = reinterpret_cast<decltype(function)>(::dlsym(handle, "oni" #function)); \
  if (function == nullptr)                                                           \
    throw DeviceError(                                                               \
        fmt::format("{} has no function oni" #function "; expected OpenNI2 2.2", name));
  PLUMB_ONI_FUNCTIONS(PLUMB_ONI_RESOLVE)
#undef PLUMB_ONI_RESOLVE
}

std::shared_ptr<const OpenNiLibrary> OpenNiLibrary::Load(const std::filesystem::path& file) {
  const std::string name =
      file.empty() ? "libOpenNI2.so.0" : std::filesystem::absolute(file).string();
  void* handle = ::dlopen(name.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr)
    throw DeviceError(
        fmt::format("OpenNI2 cannot be loaded: {}; install the package libopenni2-0", ::dlerror()));
  std::shared_ptr<OpenNiLibrary> library(new OpenNiLibrary);
  library->Resolve(handle, name);
  const OniStatus status = library->Initialize(kApiVersion);
  library->started_ = status == ONI_STATUS_OK;
  library->Check("OpenNI2 does not start with the drivers of " + name, status);
  return library;
}

OpenNiLibrary::~OpenNiLibrary() {
  if (started_) Shutdown();
}

std::string OpenNiLibrary::Describe(const std::string& what, OniStatus status) const {
  std::string details = GetExtendedError();
  while (!details.empty() && static_cast<unsigned char>(details.back()) <= ' ') details.pop_back();
  return fmt::format("{}: {}{}{}", what, StatusName(status), details.empty() ? "" : ", ", details);
}

void OpenNiLibrary::Check(const std::string& what, OniStatus status) const {
  if (status != ONI_STATUS_OK) throw DeviceError(Describe(what, status));
}

}  // namespace plumb
