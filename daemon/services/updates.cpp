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
      sticks_(
          loop, [root = options_.sticks] { return UsbSticks(root).Bundles(); },
          [this] { options_.changed(); }),
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
                   .stop = options_.stop,
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
  // Posted, because the background threads may not exist yet while this object is constructed.
  loop_.Post("channel", alive_.WhileAlive([this] {
    if (channel_) return;
    (void)options_.run_in_background(
        [folder = options_.config.folder] { RemoveChannelParts(folder); });
  }));
}

void Updates::WatchChannel() {
  const UpdateConfig& config = options_.config;
  std::string url = config.channel;
  while (url.ends_with('/')) url.pop_back();
  const auto looked = alive_.WhileAlive([this](const ChannelLook& look) { OnLooked(look); });
  channel_ = std::make_unique<ChannelWatch>(
      ChannelOptions{.url = std::move(url),
                     .channel = config.channel_name,
                     .key = config.channel_key,
                     .trusted = config.trusted,
                     .folder = config.folder,
                     .state = options_.state,
                     .serial = options_.serial,
                     .version = VersionOfSystem(options_.release, std::string(Version())),
                     .max_bytes = static_cast<std::uint64_t>(config.max_bundle_mb) << 20,
                     .every = options_.look_every,
                     .again_after = options_.look_again_after,
                     .first_after = options_.first_look_after,
                     .may_fetch = [this] { return updater_.is_free(); }},
      [&loop = loop_, looked](const ChannelLook& look) {
        loop.Post("channel", [looked, look] { looked(look); });
      });
}

void Updates::OnLooked(const ChannelLook& look) {
  look_ = look;
  if (look.is_new)
    options_.log(kInstaller, "update.offer", look.name,
                 say::channel::IsOffered(look.version, look.name));
  if (look.is_postponed) (void)updater_.status();  // which looks for an installer again
  if (!look.failure.empty()) Log(LogLevel::kWarning, look.failure.English());
  options_.changed();
}

UpdateStatus Updates::GetUpdate() {
  UpdateStatus status = updater_.status();
  status.channel_failure = look_.failure;
  const bool is_here = std::ranges::find(status.bundles, look_.name) != status.bundles.end();
  // The offered bundle may be the one that was just installed.
  if (is_here && !status.restart_needed)
    status.offered = say::channel::IsOffered(look_.version, look_.name);
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
  updater_.Add(file, name, Logged(actor, "update.upload", name, std::move(done)));
}

void Updates::RemoveBundle(const Actor& actor, const std::string& name, Done done) {
  const Change change = updater_.Remove(name);
  if (change.result == ChangeResult::kDone) options_.log(actor, "update.remove", name, {});
  done(change);
}

void Updates::InstallUpdate(const Actor& actor, const std::string& bundle, Done done) {
  if (RefuseIf(WhyNotInstall(), done)) return;
  updater_.Install(bundle, Logged(actor, "update.install", bundle, std::move(done)));
}

Done Updates::Logged(const Actor& actor, const char* action, const std::string& bundle, Done done) {
  return [this, actor, action, bundle, done = std::move(done)](const Change& change) {
    options_.log(actor, change.result == ChangeResult::kDone ? action : "update.refuse", bundle,
                 change.message);
    done(change);
  };
}

void Updates::InstallFile(const Actor& actor, std::shared_ptr<const AttachedFile> file,
                          const std::string& name, Done done) {
  CopyAndInstall(
      actor, name, [file = std::move(file)] { return file; }, options_.run_in_background, done);
}

void Updates::InstallFromStick(const Actor& actor, const std::string& bundle, Done done) {
  const auto open = [root = options_.sticks, bundle] {
    return std::make_shared<const AttachedFile>(UsbSticks(root).Open(bundle));
  };
  CopyAndInstall(
      actor, bundle, open,
      [this](std::function<void()> work) { return sticks_.Post(std::move(work)); }, done);
}

void Updates::CopyAndInstall(const Actor& actor, const std::string& name, OpenFile open,
                             const Post& post, const Done& done) {
  if (RefuseIf(WhyNotInstall(), done)) return;
  if (const UpdateStatus status = updater_.status(); !status.supported)
    return done(AnswerOf(status.message));
  if (copying_ || updater_.is_installing()) return done(AnswerOf(say::upkeep::AnotherBundle()));
  copying_ = true;
  const auto copied = alive_.WhileAlive(
      [this, actor, name, done](const std::filesystem::path& copy, const Change& failure) {
        OnCopied(actor, name, copy, failure, done);
      });
  const auto work = [name, open = std::move(open), folder = options_.config.folder,
                     max_bytes = static_cast<std::uint64_t>(options_.config.max_bundle_mb) << 20,
                     stop = options_.stop, copied, &loop = loop_] {
    Change failure;
    std::filesystem::path copy;
    try {
      const auto file = open();
      if (file->fd() < 0)
        failure = Refused(ChangeResult::kNotFound, say::upkeep::NoStick(name));
      else
        copy = CopyBundle(file->fd(), folder, max_bytes, stop);
    } catch (const DataError& error) {
      failure = Refused(ChangeResult::kInvalid, error.message());
    } catch (const std::exception& error) {
      failure = Refused(ChangeResult::kFailed, MessageOf(error));
    }
    loop.Post("bundle copied", [copied, copy, failure] { copied(copy, failure); });
  };
  if (post(work)) return;
  copying_ = false;
  done(AnswerOf(say::upkeep::DiskBusy()));
}

void Updates::OnCopied(const Actor& actor, const std::string& name,
                       const std::filesystem::path& copy, const Change& failure, const Done& done) {
  copying_ = false;
  const Done logged = Logged(actor, "update.install", name, done);
  if (copy.empty()) return logged(failure);
  const auto drop = [this, copy, logged](const Change& why) {
    updater_.DropCopy(copy);
    logged(why);
  };
  // A scan may have started during the copying.
  if (RefuseIf(WhyNotInstall(), drop)) return;
  updater_.InstallCopy(copy, name, logged);
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
    GoDown(actor, [this, done](Change change) {
      if (change.result != ChangeResult::kDone) {
        change.message = CancelFactoryReset(options_.state, change.message);
        if (change.message.Is(say::upkeep::kResetMayHappen))
          Log(LogLevel::kError, change.message.English());
      }
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
  const Message why = CancelFactoryReset(options_.state, say::upkeep::RestartNotCarriedOut());
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
