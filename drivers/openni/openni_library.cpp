// SPDX-License-Identifier: Apache-2.0
#include "drivers/openni/openni_library.hpp"

#include <dlfcn.h>

#include <utility>

#include "algo/base/errors.hpp"
#include "words/sensor.hpp"

namespace plumb {
namespace {

constexpr int kApiVersion = 2 * 1000 + 2;  // of the headers: major * 1000 + minor

Message StatusName(OniStatus status) {
  switch (status) {
    case ONI_STATUS_OK:
      return say::sensor::StatusOk();
    case ONI_STATUS_NOT_IMPLEMENTED:
      return say::sensor::StatusNotImplemented();
    case ONI_STATUS_NOT_SUPPORTED:
      return say::sensor::StatusNotSupported();
    case ONI_STATUS_BAD_PARAMETER:
      return say::sensor::StatusBadParameter();
    case ONI_STATUS_OUT_OF_FLOW:
      return say::sensor::StatusOutOfFlow();
    case ONI_STATUS_NO_DEVICE:
      return say::sensor::StatusNoDevice();
    case ONI_STATUS_TIME_OUT:
      return say::sensor::StatusTimeOut();
    case ONI_STATUS_ERROR:
      break;
  }
  return say::sensor::StatusError();
}

}  // namespace

// The library is never unloaded, because its drivers leave threads and static objects that do not
// survive it.
void OpenNiLibrary::Resolve(void* handle, const std::string& name) {
#define PLUMB_ONI_RESOLVE(function)                                                  \
  function = reinterpret_cast<decltype(function)>(::dlsym(handle, "oni" #function)); \
  if (function == nullptr) throw DeviceError(say::sensor::OpenniFunction(name, "oni" #function));
  PLUMB_ONI_FUNCTIONS(PLUMB_ONI_RESOLVE)
#undef PLUMB_ONI_RESOLVE
}

std::shared_ptr<const OpenNiLibrary> OpenNiLibrary::Load(const std::filesystem::path& file) {
  const std::string name =
      file.empty() ? "libOpenNI2.so.0" : std::filesystem::absolute(file).string();
  void* handle = ::dlopen(name.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) throw DeviceError(say::sensor::OpenniMissing(::dlerror()));
  std::shared_ptr<OpenNiLibrary> library(new OpenNiLibrary);
  library->Resolve(handle, name);
  const OniStatus status = library->Initialize(kApiVersion);
  library->started_ = status == ONI_STATUS_OK;
  library->Check(say::sensor::OpenniStart(name), status);
  return library;
}

OpenNiLibrary::~OpenNiLibrary() {
  if (started_) Shutdown();
}

Message OpenNiLibrary::Describe(Message what, OniStatus status) const {
  std::string details = GetExtendedError();
  while (!details.empty() && static_cast<unsigned char>(details.back()) <= ' ') details.pop_back();
  return details.empty()
             ? say::sensor::OpenniFailed(std::move(what), StatusName(status))
             : say::sensor::OpenniFailedWith(std::move(what), StatusName(status), details);
}

void OpenNiLibrary::Check(Message what, OniStatus status) const {
  if (status != ONI_STATUS_OK) throw DeviceError(Describe(std::move(what), status));
}

}  // namespace plumb
