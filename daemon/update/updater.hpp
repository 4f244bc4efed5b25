// SPDX-License-Identifier: Apache-2.0
// System updates through RAUC, the image's installer, over D-Bus (de.pengutronix.rauc.Installer).
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>

#include "algo/base/message.hpp"
#include "daemon/loop/event_loop.hpp"
#include "web/model/change.hpp"
#include "web/model/status.hpp"

namespace plumb {

/// An installation whose progress (percent or step) does not change for this long has failed. RAUC
/// reports nothing while it copies an image, which takes some ten minutes on a slow card; every
/// other step takes seconds.
inline constexpr std::chrono::minutes kLongestCopy{30}, kLongestOtherStep{5};

struct UpdaterOptions {
  std::filesystem::path folder = "/var/lib/plumb/updates";  ///< Folder of the bundles, NAME.raucb.
  std::uint64_t max_bytes = std::uint64_t{2} << 30;         ///< Limit for one bundle.
  std::string bus_address;                                  ///< Empty: the system bus.
  std::string version;    ///< Version that runs; an older bundle is refused.
  std::string boot = {};  ///< Unique for each start of the machine.
  /// Called before an installation begins; returns why it may not begin now, or nothing.
  std::function<Message()> blocking_reason;
  std::function<void()> changed;  ///< Called on the loop when status() has changed.
  /// Runs slow work on another thread, in order: reading or storing a whole bundle, closing a large
  /// file without a name. False: it is too busy. Empty: everything is done immediately on the loop.
  std::function<bool(std::function<void()>)> run_in_background;
  std::stop_token stop = {};  ///< Ends the reading of a bundle.
  /// Called on the loop when an installation has ended; no failure: it succeeded.
  std::function<void(const std::string& bundle, const Message& failure)> ended;
  /// Called on the loop, once: the machine has started the system from before the last update, with
  /// the evidence.
  std::function<void(const Message& why)> rolled_back = {};
  /// Time for each answer: RAUC reads the whole bundle before it gives one.
  std::chrono::milliseconds answer_within{60'000};
  /// Interval for checking whether there is progress.
  std::chrono::milliseconds look_every{10'000};
  /// For tests; empty: the steady clock.
  std::function<std::chrono::steady_clock::time_point()> now = {};
};

/// Nothing blocks: every call of the bus is answered later. A machine without a bus or without RAUC
/// is not an error; status() reports it. RAUC decides whether a bundle is acceptable (signature,
/// compatible system); size and format are checked here before, and the version afterwards. An
/// installation ends with RAUC's report, with RAUC leaving the bus, or with progress that does not
/// change; another attempt is possible each time. Used on the loop's thread.
class Updater {
 public:
  Updater(EventLoop& loop, UpdaterOptions options);
  ~Updater();
  Updater(const Updater&) = delete;
  Updater& operator=(const Updater&) = delete;

  [[nodiscard]] bool is_installing() const;
  /// There is an installer, and it installs nothing. From any thread.
  [[nodiscard]] bool is_free() const;
  /// Also searches for RAUC if there was none, at most every few seconds.
  [[nodiscard]] UpdateStatus status();
  /// Moves a file into the bundles, durably, in the background: kInvalid if it cannot be a bundle,
  /// kConflict if there are too many.
  void Add(const std::filesystem::path& file, const std::string& name, Done done);
  Change Remove(const std::string& name);
  /// Lets RAUC check and install NAME of the folder. `done` is called once it has begun, or with
  /// the reason why not.
  void Install(const std::string& name, Done done);
  /// Like Install(), for a file that was copied only to be installed and is not listed as a bundle.
  /// The copy is removed when the installation ends or is refused, whatever the outcome: it can be
  /// copied again, and copies that stay would fill the disk.
  /// @param name  Of the bundle, for people.
  void InstallCopy(const std::filesystem::path& copy, const std::string& name, Done done);
  /// Removes such a copy without installing it.
  void DropCopy(const std::filesystem::path& copy);
  /// The roll-back was acknowledged and is not reported any more.
  void ForgetRollBack();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
