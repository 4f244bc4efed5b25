// SPDX-License-Identifier: Apache-2.0
// Bundles on USB sticks, which an image mounts read-only (systemd/usb-stick). They are offered, and
// never installed automatically.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/loop/alive_flag.hpp"
#include "daemon/loop/event_loop.hpp"
#include "daemon/loop/work_thread.hpp"

namespace plumb {

/// May wait for as long as a stick lets it: not for the loop.
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

/// What is on the sticks, for the loop, which never waits for one: a thread of its own does, with
/// the priority of what can wait. Used on the loop's thread.
class StickWatch {
 public:
  /// @param look  UsbSticks::Bundles(), called on that thread.
  /// @param changed  Called on the loop when a look found something else than the one before.
  StickWatch(EventLoop& loop, std::function<std::vector<std::string>()> look,
             std::function<void()> changed);

  /// As the last look found it. Begins the next look, unless one is under way.
  [[nodiscard]] std::vector<std::string> Bundles();
  /// Work with a stick, on that thread. False if too much waits there already.
  [[nodiscard]] bool Post(std::function<void()> work) { return thread_.Post(std::move(work)); }

 private:
  EventLoop& loop_;
  const std::function<std::vector<std::string>()> look_;
  const std::function<void()> changed_;
  std::vector<std::string> bundles_;
  bool is_looking_ = false;
  AliveFlag alive_;
  WorkThread thread_{4};
};

}  // namespace plumb
