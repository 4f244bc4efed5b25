// SPDX-License-Identifier: Apache-2.0
#include "daemon/services/updates.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "daemon/archive/factory_reset.hpp"
#include "daemon/config/version.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/services/store_access.hpp"
#include "daemon/update/bundle_check.hpp"
#include "daemon/update/bundle_copy.hpp"
#include "words/audit.hpp"
#include "words/channel.hpp"
#include "words/scan.hpp"
#include "words/upkeep.hpp"

namespace plumb {

namespace {

const Actor kInstaller{.user = "installer", .address = {}};

}  // namespace

Updates::Updates(EventLoop& loop, Appliance& appliance, CurrentSession& session,
                 std::unique_ptr<SystemRestart> restart, UpdatesOptions options)
    : loop_(loop),
      appliance_(appliance),
      session_(session),
      restart_(std::move(restart)),
      options_(std::move(options)),
      sticks_(options_.sticks),
      updater_(loop,
               UpdaterOptions{
                   .folder = options_.config.folder,
                   .max_bytes = static_cast<std::uint64_t>(options_.config.max_bundle_mb) << 20,
                   .bus_address = options_.bus_address,
                   .version = VersionOfSystem(options_.release, std::string(Version())),
                   .boot = options_.boot,
                   .blocking_reason = [this] { return WhyNotInstall(); },
                   .changed = [this] { options_.changed(); },
                   .run_in_background = options_.run_in_background,
                   .ended =
                       [this](const std::string& bundle, const Message& failure) {
                         options_.log(kInstaller, failure.empty() ? "update.done" : "update.fail",
                                      bundle, failure);
                       },
                   .rolled_back =
                       [this](const Message& why) {
                         options_.log(kInstaller, "update.rolled_back", "", why);
                         appliance_.SetRolledBack(why);
                       }}) {
  session_.SetBlockingReason([this] { return WhyNotScan(); });
  restart_limit_ = loop_.MakeTimer("restart", [this] { OnStillRunning(); });
  if (!options_.config.channel.empty()) WatchChannel();
}

void Updates::WatchChannel() {
  const UpdateConfig& config = options_.config;
  std::string url = config.channel;
  while (url.ends_with('/')) url.pop_back();
  const auto looked = alive_.WhileAlive([this](const ChannelLook& look) {
    const bool is_news = look.name != look_.name && !look.name.empty();
    look_ = look;
    if (is_news)
      options_.log(kInstaller, "update.offer", look.name,
                   say::channel::IsOffered(look.version, look.name));
    if (!look.failure.empty()) Log(LogLevel::kWarning, look.failure.English());
    options_.changed();
  });
  channel_ = std::make_unique<ChannelWatch>(
      ChannelOptions{.url = std::move(url),
                     .channel = config.channel_name,
                     .key = config.channel_key,
                     .trusted = config.trusted,
                     .folder = config.folder,
                     .seen = options_.state / "channel-seen",
                     .serial = options_.serial,
                     .version = VersionOfSystem(options_.release, std::string(Version())),
                     .max_bytes = static_cast<std::uint64_t>(config.max_bundle_mb) << 20},
      [&loop = loop_, looked](const ChannelLook& look) {
        loop.Post("channel", [looked, look] { looked(look); });
      });
}

UpdateStatus Updates::GetUpdate() {
  UpdateStatus status = updater_.status();
  status.channel_failure = look_.failure;
  const bool is_here = std::ranges::find(status.bundles, look_.name) != status.bundles.end();
  if (is_here) status.offered = say::channel::IsOffered(look_.version, look_.name);
  return status;
}

Updates::~Updates() { session_.SetBlockingReason({}); }

Message Updates::WhyNotScan() const {
  if (restarting_) return say::scan::Restarting();
  if (updater_.is_installing()) return say::scan::UpdateInstalling();
  return {};
}

Message Updates::WhyNotInstall() const {
  if (restarting_) return say::scan::Restarting();
  if (Message why = appliance_.WhyNotIdle(); !why.empty()) return why;
  if (session_.IsPatients()) return say::scan::CloseBeforeInstall();
  return {};
}

Message Updates::WhyNotRestart() const {
  if (Message why = WhyNotScan(); !why.empty()) return why;
  if (Message why = appliance_.WhyNotIdle(); !why.empty()) return why;
  if (session_.IsPatients()) return say::scan::CloseBeforeRestart();
  return {};
}

void Updates::AddBundle(const Actor& actor, const std::filesystem::path& file,
                        const std::string& name, Done done) {
  const Change change = updater_.Add(file, name);
  options_.log(actor, change.result == ChangeResult::kDone ? "update.upload" : "update.refuse",
               name, change.message);
  done(change);
}

void Updates::RemoveBundle(const Actor& actor, const std::string& name, Done done) {
  const Change change = updater_.Remove(name);
  if (change.result == ChangeResult::kDone) options_.log(actor, "update.remove", name, {});
  done(change);
}

void Updates::InstallUpdate(const Actor& actor, const std::string& bundle, Done done) {
  if (RefuseIf(WhyNotInstall(), done)) return;
  updater_.Install(bundle, LogInstall(actor, bundle, std::move(done)));
}

Done Updates::LogInstall(const Actor& actor, const std::string& bundle, Done done) {
  return [this, actor, bundle, done = std::move(done)](const Change& change) {
    options_.log(actor, change.result == ChangeResult::kDone ? "update.install" : "update.refuse",
                 bundle, change.message);
    done(change);
  };
}

void Updates::InstallFile(const Actor& actor, std::shared_ptr<const AttachedFile> file,
                          const std::string& name, Done done) {
  if (RefuseIf(WhyNotInstall(), done)) return;
  if (const UpdateStatus status = updater_.status(); !status.supported)
    return done(AnswerOf(status.message));
  if (copying_ || updater_.is_installing()) return done(AnswerOf(say::upkeep::AnotherBundle()));
  copying_ = true;
  const auto copied = alive_.WhileAlive(
      [this, actor, name, done](const std::filesystem::path& copy, const Change& failure) {
        copying_ = false;
        if (copy.empty()) {
          options_.log(actor, "update.refuse", name, failure.message);
          return done(failure);
        }
        const auto drop = [copy, done](const Change& why) {
          std::error_code ignored;
          std::filesystem::remove(copy, ignored);
          done(why);
        };
        // A scan may have started during the copying.
        if (RefuseIf(WhyNotInstall(), drop)) return;
        AddBundle(actor, copy, name, [this, actor, name, drop, done](const Change& added) {
          if (added.result != ChangeResult::kDone) return drop(added);
          updater_.InstallCopy(name, LogInstall(actor, name, done));
        });
      });
  const auto work = [file = std::move(file), folder = options_.config.folder,
                     max_bytes = static_cast<std::uint64_t>(options_.config.max_bundle_mb) << 20,
                     copied, &loop = loop_] {
    Change failure;
    std::filesystem::path copy;
    try {
      copy = CopyBundle(file->fd(), folder, max_bytes);
    } catch (const DataError& error) {
      failure = Refused(ChangeResult::kInvalid, error.message());
    } catch (const std::exception& error) {
      failure = Refused(ChangeResult::kFailed, MessageOf(error));
    }
    loop.Post("bundle copied", [copied, copy, failure] { copied(copy, failure); });
  };
  if (options_.run_in_background(work)) return;
  copying_ = false;
  done(AnswerOf(say::upkeep::DiskBusy()));
}

void Updates::InstallFromStick(const Actor& actor, const std::string& bundle, Done done) {
  auto file = std::make_shared<const AttachedFile>(sticks_.Open(bundle));
  if (file->fd() < 0) {
    return done(Refused(ChangeResult::kNotFound, say::upkeep::NoStick(bundle)));
  }
  InstallFile(actor, std::move(file), bundle, std::move(done));
}

void Updates::RestartSystem(const Actor& actor, Done done) {
  if (RefuseIf(WhyNotRestart(), done)) return;
  restarting_ = true;  // no scan, session or update may begin before the machine goes down
  GoDown(actor, std::move(done));
}

void Updates::ResetToFactory(const Actor& actor, FactoryReset kind, Done done) {
  if (RefuseIf(WhyNotRestart(), done)) return;
  restarting_ = true;
  const auto noted = alive_.WhileAlive([this, actor, kind, done](const Message& failure) {
    if (!failure.empty()) {
      restarting_ = false;
      return done(Refused(ChangeResult::kFailed, failure));
    }
    options_.log(
        actor, "system.factory_reset_request", "",
        kind == FactoryReset::kWipe ? say::audit::EverythingRemoved() : say::audit::RecordsKept());
    GoDown(actor, [this, done](const Change& change) {
      if (change.result != ChangeResult::kDone) CancelFactoryReset(options_.state);
      done(change);
    });
  });
  const auto work = [state = options_.state, actor, kind, noted, &loop = loop_] {
    Message failure;
    try {
      RequestFactoryReset(state, kind, actor);
    } catch (const std::exception& error) {
      failure = MessageOf(error);
    }
    loop.Post("factory reset noted", [noted, failure] { noted(failure); });
  };
  if (options_.run_in_background(work)) return;
  restarting_ = false;
  done(AnswerOf(say::upkeep::DiskBusy()));
}

void Updates::GoDown(const Actor& actor, Done done) {
  options_.log(actor, "system.restart", "", {});
  Log(LogLevel::kNotice, fmt::format("{} restarts the machine", actor.user));
  restart_->Restart(
      alive_.WhileAlive([this, actor, done = std::move(done)](const Message& failure) {
        if (failure.empty()) {
          restarted_by_ = actor;
          restart_limit_.ArmAfter(restart_->limit());
          return done({});
        }
        restarting_ = false;
        options_.log(actor, "system.restart_failed", "", failure);
        Log(LogLevel::kError, failure.English());
        done(Refused(ChangeResult::kFailed, failure));
      }));
}

void Updates::OnStillRunning() {
  Message why = say::upkeep::RestartNotCarriedOut();
  try {
    CancelFactoryReset(options_.state);
  } catch (const std::exception& error) {
    why = say::upkeep::ResetMayHappen(MessageOf(error));
  }
  restarting_ = false;
  options_.log(restarted_by_, "system.restart_failed", "", why);
  Log(LogLevel::kError, why.English());
}

void Updates::ForgetRollBack(const Actor& actor, Done done) {
  if (updater_.status().rolled_back.empty()) return done(AnswerOf(say::upkeep::NotRolledBack()));
  updater_.ForgetRollBack();
  appliance_.SetRolledBack({});
  options_.log(actor, "update.seen", "", {});
  done({});
}

}  // namespace plumb
