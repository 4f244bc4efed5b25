// SPDX-License-Identifier: Apache-2.0
// A maker's library, loaded at run time: nothing of it is needed to build Plumb.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "algo/base/message.hpp"

namespace plumb {

struct SdkTitle {
  std::string name;           ///< As people know it: "librealsense2".
  std::string prefix;         ///< Of its files, up to the version: "librealsense2.so.2.".
  std::string least;          ///< Oldest version that is used: "2.36".
  std::string guide;          ///< Where the manual says how to install it.
  bool states_camera = true;  ///< As SensorDriver's.
};

/// A loaded library. It is never unloaded, because such libraries leave threads behind.
class SdkLibrary {
 public:
  SdkLibrary(const SdkLibrary&) = delete;
  SdkLibrary& operator=(const SdkLibrary&) = delete;

  /// Where makers' installations and packages put it.
  [[nodiscard]] static std::vector<std::filesystem::path> Folders();
  /// The newest file with the prefix, compared number by number; empty if there is none.
  [[nodiscard]] static std::filesystem::path FindIn(
      const std::string& prefix, const std::vector<std::filesystem::path>& folders);

  [[nodiscard]] const SdkTitle& title() const { return title_; }
  [[nodiscard]] const std::string& file() const { return file_; }
  [[nodiscard]] const std::string& version() const { return version_; }

 protected:
  /// @param file  Empty: the newest of Folders().
  /// @throws DeviceError if there is none or it cannot be loaded.
  SdkLibrary(SdkTitle title, const std::filesystem::path& file);
  ~SdkLibrary() = default;

  /// @throws DeviceError if the library does not have it.
  [[nodiscard]] void* Function(const char* name) const;
  /// States the version. @throws DeviceError unless it is of title().least or newer, with the same
  /// first number.
  void SetVersion(const std::string& version);

 private:
  const SdkTitle title_;
  std::string file_, version_;
  void* handle_ = nullptr;
};

/// @throws DeviceError "what: reason", always.
[[noreturn]] void ThrowSdkFailure(const Message& what, std::string reason);

/// Calls of a library whose functions report by their last parameter, an error object. `Library`
/// derives from it, and has `std::string TakeReason(Error*) const`, which frees the object.
template <typename Library, typename Error>
class SdkCalls : public SdkLibrary {
 public:
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
    (void)library().TakeReason(error);
    return otherwise;
  }
  /// Likewise; whether there was no error.
  template <typename Function, typename... Arguments>
  bool Try(Function function, Arguments... arguments) const {
    Error* error = nullptr;
    function(arguments..., &error);
    if (error == nullptr) return true;
    (void)library().TakeReason(error);
    return false;
  }

 protected:
  using SdkLibrary::SdkLibrary;
  ~SdkCalls() = default;

 private:
  [[nodiscard]] const Library& library() const { return static_cast<const Library&>(*this); }
  void Check(const Message& what, Error* error) const {
    if (error != nullptr) ThrowSdkFailure(what, library().TakeReason(error));
  }
};

}  // namespace plumb
