// SPDX-License-Identifier: Apache-2.0
// System updates, the restart after them and the factory reset, for page and control socket.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <stop_token>
#include <string>

#include "algo/base/message.hpp"
#include "daemon/appliance/appliance.hpp"
#include "daemon/control/attached_file.hpp"
#include "daemon/loop/alive_flag.hpp"
#include "daemon/update/channel.hpp"
#include "daemon/update/system_restart.hpp"
#include "daemon/update/updater.hpp"
#include "daemon/update/usb_sticks.hpp"
#include "web/service/upkeep_services.hpp"

namespace plumb {

struct UpdatesOptions {
  UpdateConfig config;
  std::filesystem::path state;                        ///< State folder for a factory reset.
  std::filesystem::path sticks = "/run/plumb-stick";  ///< See UsbSticks.
  /// Looks at the channel: see ChannelOptions.
  std::chrono::milliseconds first_look_after = std::chrono::minutes(5);
  std::chrono::milliseconds look_every = std::chrono::hours(24);
  std::chrono::milliseconds look_again_after = std::chrono::hours(1);
  std::string serial = {};  ///< Of this unit: its place in the fleet; empty: the host's name.
  std::filesystem::path release = "/etc/plumb-release";  ///< See VersionOfSystem().
  std::string bus_address = {};                          ///< Empty: the system bus.
  std::string boot = {};  ///< Unique for each start of the machine; empty if unknown.
  std::function<bool(std::function<void()>)> run_in_background;  ///< See UpdaterOptions.
  std::stop_token stop = {};                                     ///< Ends copies of bundles.
  std::function<void()> changed;  ///< Called when GetUpdate() has changed.
  std::function<void(const Actor& actor, const char* action, const std::string& subject,
                     const Message& detail)>
      log;  ///< Writes to the audit log.
};

/// Used on the loop's thread. Nothing is installed or restarted during a scan, and no scan begins
/// during an update.
class Updates : public web::UpdateService {
 public:
  /// The first three are borrowed. @param restart  Restarts the machine.
  Updates(EventLoop& loop, Appliance& appliance, CurrentSession& session,
          std::unique_ptr<SystemRestart> restart, UpdatesOptions options);
  ~Updates() override;
  Updates(const Updates&) = delete;
  Updates& operator=(const Updates&) = delete;

  [[nodiscard]] UpdateStatus GetUpdate() override;
  void AddBundle(const Actor& actor, const std::filesystem::path& file, const std::string& name,
                 Done done) override;
  void RemoveBundle(const Actor& actor, const std::string& name, Done done) override;
  void InstallUpdate(const Actor& actor, const std::string& bundle, Done done) override;
  /// Copies the open file to the bundles, off the loop, then installs it. The copy is removed
  /// when the installation has ended or was refused.
  void InstallFile(const Actor& actor, std::shared_ptr<const AttachedFile> file,
                   const std::string& name, Done done);
  [[nodiscard]] std::vector<std::string> StickBundles() override { return sticks_.Bundles(); }
  void InstallFromStick(const Actor& actor, const std::string& bundle, Done done) override;
  void RestartSystem(const Actor& actor, Done done) override;
  void ResetToFactory(const Actor& actor, FactoryReset kind, Done done) override;
  void ForgetRollBack(const Actor& actor, Done done) override;

 private:
  using OpenFile = std::function<std::shared_ptr<const AttachedFile>()>;
  using Post = std::function<bool(std::function<void()>)>;

  void WatchChannel();
  void OnLooked(const ChannelLook& look);
  /// Passes the answer on to `done` and writes it to the audit log.
  /// @param action  Of an answer without a refusal.
  [[nodiscard]] Done Logged(const Actor& actor, const char* action, const std::string& bundle,
                            Done done);
  /// See InstallFile(). @param open  Called where `post` runs its work.
  void CopyAndInstall(const Actor& actor, const std::string& name, OpenFile open, const Post& post,
                      const Done& done);
  void OnCopied(const Actor& actor, const std::string& name, const std::filesystem::path& copy,
                const Change& failure, const Done& done);
  /// Why no update may begin now, during which no scan can begin: a scan runs, or a patient's
  /// session is open (the demo's does not count). Empty if it may.
  [[nodiscard]] Message WhyNotInstall() const;
  /// The same for a restart of the machine.
  [[nodiscard]] Message WhyNotRestart() const;
  /// Why no scan may begin now; empty if it may.
  [[nodiscard]] Message WhyNotScan() const;
  /// Requests the restart; `restarting_` is set.
  void GoDown(const Actor& actor, Done done);
  /// The machine still runs although its restart was accepted: scans are possible again, and no
  /// later restart carries out a factory reset that was requested with this one.
  void OnStillRunning();

  EventLoop& loop_;
  Appliance& appliance_;
  CurrentSession& session_;
  std::unique_ptr<SystemRestart> restart_;
  UpdatesOptions options_;
  StickWatch sticks_;
  bool restarting_ = false, copying_ = false;
  Actor restarted_by_;
  EventLoop::Source restart_limit_;
  ChannelLook look_;  ///< The newest.
  AliveFlag alive_;
  Updater updater_;                        // After the members that its callbacks use.
  std::unique_ptr<ChannelWatch> channel_;  ///< Null: no channel is configured. It asks the updater.
};

}  // namespace plumb
