#include "daemon/appliance/updates.hpp"

#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "daemon/appliance/store_access.hpp"
#include "daemon/config/version.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/records/factory_reset.hpp"
#include "daemon/update/bundle_check.hpp"
#include "daemon/update/bundle_copy.hpp"

namespace plumb {

namespace {

const Actor kInstaller{.user = "installer", .address = {}};

}  // namespace

Updates::Updates(Appliance& appliance, std::unique_ptr<SystemRestart> restart,
                 UpdatesOptions options)
    : appliance_(appliance),
      restart_(std::move(restart)),
      options_(std::move(options)),
      sticks_(options_.sticks),
      updater_(appliance.loop(),
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
                       [this](const std::string& bundle, const std::string& failure) {
                         options_.log(kInstaller, failure.empty() ? "update.done" : "update.fail",
                                      bundle, failure);
                       },
                   .rolled_back =
                       [this](const std::string& text) {
                         options_.log(kInstaller, "update.rolled_back", "", text);
                         appliance_.SetRolledBack(text);
                       }}) {
  appliance_.SetBlockingReason([this] { return WhyNotScan(); });
  restart_limit_ = appliance_.loop().MakeTimer("restart", [this] { OnStillRunning(); });
}

Updates::~Updates() { appliance_.SetBlockingReason({}); }

std::string Updates::WhyNotScan() const {
  if (restarting_) return "the machine is being restarted";
  if (updater_.is_installing()) return "a system update is being installed: wait until it is done";
  return {};
}

std::string Updates::WhyNotInstall() const {
  if (restarting_) return "the machine is being restarted";
  return appliance_.WhyNotInstall();
}

std::string Updates::WhyNotRestart() const {
  if (std::string why = WhyNotScan(); !why.empty()) return why;
  return appliance_.WhyNotRestart();
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
  if (change.result == ChangeResult::kDone) options_.log(actor, "update.remove", name, "");
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
  if (copying_ || updater_.is_installing())
    return done(AnswerOf("another bundle is being installed: wait until it is done"));
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
                     copied, &loop = appliance_.loop()] {
    Change failure;
    std::filesystem::path copy;
    try {
      copy = CopyBundle(file->fd(), folder, max_bytes);
    } catch (const DataError& error) {
      failure = Refused(ChangeResult::kInvalid, error.what());
    } catch (const std::exception& error) {
      failure = Refused(ChangeResult::kFailed, error.what());
    }
    loop.Post("bundle copied", [copied, copy, failure] { copied(copy, failure); });
  };
  if (options_.run_in_background(work)) return;
  copying_ = false;
  done(AnswerOf("the disk is busy: try again"));
}

void Updates::InstallFromStick(const Actor& actor, const std::string& bundle, Done done) {
  auto file = std::make_shared<const AttachedFile>(sticks_.Open(bundle));
  if (file->fd() < 0) {
    return done(Refused(ChangeResult::kNotFound,
                        fmt::format("no USB stick with {} is plugged in", bundle)));
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
  const auto noted = alive_.WhileAlive([this, actor, kind, done](const std::string& failure) {
    if (!failure.empty()) {
      restarting_ = false;
      return done(Refused(ChangeResult::kFailed, failure));
    }
    options_.log(actor, "system.factory_reset_request", "",
                 kind == FactoryReset::kWipe ? "everything is removed" : "records are kept");
    GoDown(actor, [this, done](const Change& change) {
      if (change.result != ChangeResult::kDone) CancelFactoryReset(options_.state);
      done(change);
    });
  });
  const auto work = [state = options_.state, actor, kind, noted, &loop = appliance_.loop()] {
    std::string failure;
    try {
      RequestFactoryReset(state, kind, actor);
    } catch (const std::exception& error) {
      failure = error.what();
    }
    loop.Post("factory reset noted", [noted, failure] { noted(failure); });
  };
  if (options_.run_in_background(work)) return;
  restarting_ = false;
  done(AnswerOf("the disk is busy: try again"));
}

void Updates::GoDown(const Actor& actor, Done done) {
  options_.log(actor, "system.restart", "", "");
  Log(LogLevel::kNotice, fmt::format("{} restarts the machine", actor.user));
  restart_->Restart(
      alive_.WhileAlive([this, actor, done = std::move(done)](const std::string& failure) {
        if (failure.empty()) {
          restarted_by_ = actor;
          restart_limit_.ArmAfter(restart_->limit());
          return done({});
        }
        restarting_ = false;
        options_.log(actor, "system.restart_failed", "", failure);
        Log(LogLevel::kError, failure);
        done(Refused(ChangeResult::kFailed, failure));
      }));
}

void Updates::OnStillRunning() {
  std::string text =
      "the system accepted the restart but did not carry it out: switch the unit off and on";
  try {
    CancelFactoryReset(options_.state);
  } catch (const std::exception& error) {
    text += fmt::format("; a requested factory reset may still take place ({})", error.what());
  }
  restarting_ = false;
  options_.log(restarted_by_, "system.restart_failed", "", text);
  Log(LogLevel::kError, text);
}

void Updates::ForgetRollBack(const Actor& actor, Done done) {
  if (updater_.status().rolled_back.empty())
    return done(AnswerOf("the machine has not been rolled back"));
  updater_.ForgetRollBack();
  appliance_.SetRolledBack({});
  options_.log(actor, "update.seen", "", "");
  done({});
}

}  // namespace plumb
