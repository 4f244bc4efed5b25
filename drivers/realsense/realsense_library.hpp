// SPDX-License-Identifier: Apache-2.0
// librealsense2, loaded at run time through its C interface.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "algo/base/errors.hpp"
#include "algo/base/message.hpp"
#include "drivers/realsense/realsense_api.hpp"

namespace plumb::realsense {

/// The functions of a loaded library. It is never unloaded, because it leaves threads behind.
class RealSenseLibrary {
 public:
  /// @param file  Empty: the newest of the folders in LibraryFolders().
  /// @throws DeviceError if there is none, it cannot be loaded, or it is of another version.
  [[nodiscard]] static std::shared_ptr<const RealSenseLibrary> Load(
      const std::filesystem::path& file);
  /// Where the SDK's own installation and packages put it.
  [[nodiscard]] static std::vector<std::filesystem::path> LibraryFolders();
  /// The newest `librealsense2.so.2.*` in the folders; empty if there is none.
  [[nodiscard]] static std::filesystem::path FindIn(
      const std::vector<std::filesystem::path>& folders);

  [[nodiscard]] const std::string& file() const { return file_; }
  [[nodiscard]] int api_version() const { return api_version_; }
  /// "2.56.5".
  [[nodiscard]] std::string version() const;

  /// Calls a function of the library with these arguments and an error to be filled.
  /// @throws DeviceError "what: the library's reason".
  template <typename Function, typename... Arguments>
  auto Call(const Message& what, Function function, Arguments... arguments) const {
    Error* error = nullptr;
    if constexpr (std::is_void_v<decltype(function(arguments..., &error))>) {
      function(arguments..., &error);
      Check(what, error);
    } else {
      const auto result = function(arguments..., &error);
      Check(what, error);
      return result;
    }
  }
  /// Likewise; an error counts as this result.
  template <typename Result, typename Function, typename... Arguments>
  Result CallOr(Result otherwise, Function function, Arguments... arguments) const {
    Error* error = nullptr;
    const auto result = function(arguments..., &error);
    if (error == nullptr) return static_cast<Result>(result);
    free_error(error);
    return otherwise;
  }
  /// Likewise; whether there was no error.
  template <typename Function, typename... Arguments>
  bool Try(Function function, Arguments... arguments) const {
    Error* error = nullptr;
    function(arguments..., &error);
    if (error != nullptr) free_error(error);
    return error == nullptr;
  }

#define PLUMB_RS_DECLARE(result, name, parameters) result(*name) parameters = nullptr;
  PLUMB_RS_FUNCTIONS(PLUMB_RS_DECLARE)
#undef PLUMB_RS_DECLARE

 private:
  RealSenseLibrary() = default;
  void Resolve(void* handle);
  /// Frees the error.
  void Check(const Message& what, Error* error) const;

  std::string file_;
  int api_version_ = 0;
};

/// Owns one of the library's objects.
template <typename Object>
using Owned = std::unique_ptr<Object, void (*)(Object*)>;

}  // namespace plumb::realsense
