// SPDX-License-Identifier: Apache-2.0
// Bundles on USB sticks, which an image mounts read-only (systemd/usb-stick). They are offered, and
// never installed automatically.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace plumb {

class UsbSticks {
 public:
  /// @param root  Contains one folder per stick.
  explicit UsbSticks(std::filesystem::path root = "/run/plumb-stick") : root_(std::move(root)) {}

  /// Names of files NAME.raucb in the top folders of the sticks, sorted, each once; at most 32.
  [[nodiscard]] std::vector<std::string> Bundles() const;
  /// A descriptor for reading that bundle, to be closed by the caller; -1 if it does not exist (any
  /// more).
  [[nodiscard]] int Open(const std::string& name) const;

 private:
  [[nodiscard]] std::vector<std::filesystem::path> Files() const;

  std::filesystem::path root_;
};

}  // namespace plumb
