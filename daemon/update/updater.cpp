// SPDX-License-Identifier: Apache-2.0
#include "daemon/update/updater.hpp"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <map>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "daemon/loop/log.hpp"
#include "daemon/update/bundle_check.hpp"
#include "daemon/update/bundle_folder.hpp"
#include "daemon/update/bus.hpp"
#include "daemon/update/last_update.hpp"
#include "words/update.hpp"
#include "words/upkeep.hpp"

namespace plumb {

namespace {

constexpr const char* kService = "de.pengutronix.rauc";
constexpr const char* kPath = "/";
constexpr const char* kInstaller = "de.pengutronix.rauc.Installer";
constexpr const char* kProperties = "org.freedesktop.DBus.Properties";
constexpr auto kLookAgain = std::chrono::seconds(5);
constexpr std::size_t kMaxText = 500;

/// Texts of a service are shown to people, so they are bounded and stripped of anything that is not
/// text.
std::string Shown(const char* text) {
  std::string shown(text != nullptr ? text : "");
  if (shown.size() > kMaxText) shown.resize(kMaxText);
  std::replace_if(
      shown.begin(), shown.end(), [](unsigned char c) { return c < 0x20 || c == 0x7F; }, ' ');
  return shown;
}

UpdaterOptions WithDefaults(UpdaterOptions options) {
  if (!options.now) options.now = [] { return std::chrono::steady_clock::now(); };
  if (!options.run_in_background)
    options.run_in_background = [](const std::function<void()>& work) {
      work();
      return true;
    };
  return options;
}

}  // namespace

struct Updater::Impl {
  Impl(EventLoop& on, UpdaterOptions given)
      : loop(on),
        options(WithDefaults(std::move(given))),
        folder(options.folder, options.max_bytes, options.run_in_background),
        bus(on, "bus", [this] { OnBroken(); }) {
    watch = loop.MakeTimer("update progress", [this] { CheckProgress(); });
    folder.RemoveUnfinished();
    // What an unknown start has installed, this one may run or not.
    if (!options.boot.empty()) last = ReadLastUpdate(options.folder);
    Connect();
  }
  ~Impl() {
    *alive = false;
    Disconnect();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  /// What the look at a bundle has found before RAUC is asked.
  struct Finding {
    Message why_no_bundle;
    BundleState state = BundleState::kUnknown;
  };

  EventLoop& loop;
  UpdaterOptions options;
  BundleFolder folder;
  Bus bus;
  /// An update after which the machine was not restarted, or that it did not keep.
  std::optional<LastUpdate> last;
  bool roll_back_reported = false;
  std::chrono::steady_clock::time_point looked_at;
  std::atomic<bool> is_there = false, is_installing = false;  ///< Written by the loop alone.
  std::string slot, compatible;
  Message step, outcome;
  std::string last_error;  ///< In RAUC's words.
  std::string version;     ///< Version of the installing or installed bundle.
  /// Failure of the last attempt; empty if it succeeded or there was none.
  Message last_failure;
  /// State of the bundle that is being installed or examined.
  BundleState state = BundleState::kUnknown;
  std::map<std::string, BundleState> states;  ///< States of bundles examined before.
  std::shared_ptr<bool> alive = std::make_shared<bool>(true);  ///< For work on other threads.
  EventLoop::Source watch;                                     ///< Armed while RAUC installs.
  std::chrono::steady_clock::time_point moved_at;  ///< Time of the last change of its progress.
  bool given_up = false;   ///< The last installation made no progress; RAUC may still end it.
  double last_done = 0.0;  ///< As RAUC reports it.
  bool is_called = false;  ///< RAUC has been asked to install.
  bool has_begun = false;  ///< It has then reported less than 100 %.
  double fraction = 0.0;
  std::string bundle;          ///< Its name, for people.
  std::filesystem::path file;  ///< Where it lies.
  std::filesystem::path copy;  ///< File to remove when its installation ends.
  Done done;

  void Disconnect() {
    is_there = false;
    bus.Close();
  }

  void OnBroken() {
    if (is_installing && done) {
      Refuse(ChangeResult::kFailed, say::update::InstallerLost());
    } else if (is_installing) {
      End(say::update::InstallerLost());
    }
    is_there = false;
    Notify();
  }

  void Connect() {
    looked_at = std::chrono::steady_clock::now();
    if (!bus.Open(options.bus_address, options.answer_within)) return;  // no bus on this machine
    sd_bus_match_signal_async(bus.get(), nullptr, kService, kPath, kProperties, "PropertiesChanged",
                              &Impl::OnChanged, nullptr, this);
    sd_bus_match_signal_async(bus.get(), nullptr, kService, kPath, kInstaller, "Completed",
                              &Impl::OnCompleted, nullptr, this);
    const std::string owner = fmt::format(
        "type='signal',sender='{0}',path='/org/freedesktop/DBus',interface='{0}',"
        "member='NameOwnerChanged',arg0='{1}'",
        "org.freedesktop.DBus", kService);
    sd_bus_add_match_async(bus.get(), nullptr, owner.c_str(), &Impl::OnOwner, nullptr, this);
    Look();
    bus.Process();
  }

  void Look() {
    looked_at = std::chrono::steady_clock::now();
    sd_bus_call_method_async(bus.get(), nullptr, kService, kPath, kProperties, "GetAll",
                             &Impl::OnProperties, this, "s", kInstaller);
  }

  void Notify() const {
    if (options.changed) options.changed();
  }

  /// Another file has this name by now, or none has.
  void ForgetBundle(const std::string& name) {
    states.erase((options.folder / name).string());
    Notify();
  }

  void Answer(Change change) {
    if (auto asked = std::exchange(done, nullptr)) asked(change);
  }

  /// Whatever RAUC waits for, users must not be left waiting with it.
  void CheckProgress() {
    if (!is_installing) return;
    const std::chrono::minutes longest =
        step.English().find("Copying") != std::string::npos ? kLongestCopy : kLongestOtherStep;
    if (options.now() - moved_at < longest) return watch.ArmAfter(options.look_every);
    End(say::update::NoProgress(longest.count(), 100.0 * fraction, step));
    given_up = true;
  }

  void End(const Message& failure) {
    is_installing = given_up = false;
    watch.Disarm();
    last_failure = failure;
    if (failure.empty()) Remember();
    fraction = failure.empty() ? 1.0 : 0.0;
    outcome = failure.empty() ? say::update::Installed(bundle)
                              : say::update::NotInstalled(bundle, failure);
    Log(failure.empty() ? LogLevel::kNotice : LogLevel::kError, outcome.English());
    if (!copy.empty()) RemoveCopy(std::exchange(copy, {}));
    if (options.ended) options.ended(bundle, failure);
    Notify();
  }

  /// If the installation was given up, RAUC may still be reading the file: it has it open, so that
  /// the contents remain.
  void RemoveCopy(const std::filesystem::path& path) {
    if (const Message why = folder.Drop(path); !why.empty()) Log(LogLevel::kWarning, why.English());
    states.erase(path.string());
  }

  /// The next start must know what was installed, and from which system.
  void Remember() {
    last = LastUpdate{.version = version, .from_slot = slot, .boot = options.boot};
    roll_back_reported = false;
    try {
      WriteLastUpdate(options.folder, *last);
    } catch (const std::exception& error) {
      Log(LogLevel::kWarning,
          fmt::format("after a restart nothing will say whether {} was kept: {}", version,
                      error.what()));
    }
  }

  void ForgetLast() {
    last.reset();
    try {
      RemoveLastUpdate(options.folder);
    } catch (const std::exception& error) {
      Log(LogLevel::kWarning,
          fmt::format("after a restart an earlier update may be reported: {}", error.what()));
    }
  }

  [[nodiscard]] Message RolledBack() const {
    return last && is_there ? WhyRolledBack(*last, slot, options.boot, options.version) : Message();
  }

  /// Runs `work` in the background, and `then` with its result on the loop.
  /// @return false if the background has too much to do
  template <typename Work, typename Then>
  [[nodiscard]] bool InBackground(const char* what, Work work, Then then) {
    return options.run_in_background(
        [what, work = std::move(work), then = std::move(then), is_alive = alive, &on = loop] {
          on.Post(what, [found = work(), then, is_alive] {
            if (*is_alive) then(found);
          });
        });
  }

  [[nodiscard]] Message WhyNotNow() const {
    if (bus.get() == nullptr || !is_there) return say::update::NoInstaller();
    return is_installing ? say::update::InstallingThis(bundle) : Message();
  }

  /// An installation that is asked for meanwhile is looked at after it, in the same background.
  void Add(const std::filesystem::path& from, const std::string& name, const Done& asked) {
    if (const Message why = WhyNotNow(); !why.empty())
      return asked(Refused(ChangeResult::kConflict, why));
    const bool begins = InBackground(
        "bundle stored", [into = folder, from, name] { return into.Add(from, name); },
        [this, name, asked](const Change& change) {
          if (change.result == ChangeResult::kDone) ForgetBundle(name);
          asked(change);
        });
    if (!begins) asked(Refused(ChangeResult::kConflict, say::upkeep::DiskBusy()));
  }

  void Install(const std::string& name, Done asked) {
    if (WhyNotNow().empty() && !folder.Has(name))
      return asked(Refused(ChangeResult::kNotFound, say::update::NoSuchBundle()));
    Begin(options.folder / name, name, std::move(asked));
  }

  void InstallCopy(const std::filesystem::path& path, const std::string& name, Done asked) {
    Begin(path, name, [this, path, asked = std::move(asked)](const Change& change) {
      if (change.result == ChangeResult::kDone) {
        copy = path;
      } else {
        RemoveCopy(path);
      }
      asked(change);
    });
  }

  void Begin(const std::filesystem::path& from, const std::string& name, Done asked) {
    if (const Message why = WhyNotNow(); !why.empty())
      return asked(Refused(ChangeResult::kConflict, why));
    is_installing = true;
    given_up = is_called = has_begun = false;
    bundle = name;
    file = from;
    fraction = 0.0;
    step = say::update::CheckingSignature();
    last_error.clear();
    outcome = last_failure = {};
    done = std::move(asked);
    state = BundleState::kUnknown;
    Notify();
    const auto look = [from, name, most = options.max_bytes, stop = options.stop] {
      Finding found{.why_no_bundle = WhyNoBundle(from, most, name)};
      if (found.why_no_bundle.empty()) found.state = LookForDamage(from, stop);
      return found;
    };
    if (!InBackground("bundle", look, [this](const Finding& found) { Ask(found); }))
      Refuse(ChangeResult::kConflict, say::upkeep::DiskBusy());
  }

 private:
  void NoteRollBack() {
    const Message why = RolledBack();
    if (why.empty() || roll_back_reported) return;
    roll_back_reported = true;
    Log(LogLevel::kError, why.English());
    if (options.rolled_back) options.rolled_back(why);
  }

  /// Name and value of one property; unknown ones are skipped.
  void ReadProperty(sd_bus_message* message) {
    const char* name = nullptr;
    if (sd_bus_message_read_basic(message, 's', &name) < 0) return;
    const std::string key = name;
    const char* text = nullptr;
    if (key == "Progress") {
      std::int32_t percent = 0, depth = 0;
      if (sd_bus_message_read(message, "v", "(isi)", &percent, &text, &depth) < 0) return;
      const double now_done = std::clamp(percent, 0, 100) / 100.0;
      const Message now_step = Message::Verbatim(Shown(text));
      if (now_done != last_done || !(step == now_step)) moved_at = options.now();
      // Until the installation has begun, this is the progress of RAUC's look at the bundle.
      if (is_called && now_done < 1.0) has_begun = true;
      if (!given_up) fraction = has_begun ? now_done : 0.0;
      last_done = now_done;
      step = now_step;
    } else if (key == "BootSlot" || key == "Compatible" || key == "LastError" ||
               key == "Operation") {
      if (sd_bus_message_read(message, "v", "s", &text) < 0) return;
      if (key == "Compatible") compatible = Shown(text);
      if (key == "BootSlot") slot = Shown(text);
      if (key == "LastError") last_error = Shown(text);
    } else {
      sd_bus_message_skip(message, "v");
    }
  }

  void ReadProperties(sd_bus_message* message) {
    if (sd_bus_message_enter_container(message, 'a', "{sv}") < 0) return;
    while (sd_bus_message_enter_container(message, 'e', "sv") > 0) {
      ReadProperty(message);
      if (sd_bus_message_exit_container(message) < 0) return;
    }
    sd_bus_message_exit_container(message);
  }

  static int OnProperties(sd_bus_message* message, void* self, sd_bus_error*) {
    auto* impl = static_cast<Impl*>(self);
    const bool was_there = impl->is_there;
    impl->is_there = sd_bus_message_is_method_error(message, nullptr) == 0;
    if (impl->is_there) impl->ReadProperties(message);
    impl->NoteRollBack();
    if (impl->is_there != was_there) impl->Notify();
    return 0;
  }

  static int OnChanged(sd_bus_message* message, void* self, sd_bus_error*) {
    auto* impl = static_cast<Impl*>(self);
    const char* interface = nullptr;
    if (sd_bus_message_read_basic(message, 's', &interface) < 0 ||
        std::strcmp(interface, kInstaller) != 0)
      return 0;
    impl->is_there = true;
    impl->ReadProperties(message);
    impl->Notify();
    return 0;
  }

  static int OnCompleted(sd_bus_message* message, void* self, sd_bus_error*) {
    auto* impl = static_cast<Impl*>(self);
    std::int32_t result = -1;
    if (!(impl->is_installing || impl->given_up) || impl->done ||
        sd_bus_message_read_basic(message, 'i', &result) < 0)
      return 0;
    impl->End(result == 0                ? Message()
              : impl->last_error.empty() ? say::update::InstallerSilent()
                                         : Message::Verbatim(impl->last_error));
    return 0;
  }

  /// RAUC has left the bus and will never report the end of the installation. A call that it has
  /// not answered is answered by the bus.
  static int OnOwner(sd_bus_message* message, void* self, sd_bus_error*) {
    auto* impl = static_cast<Impl*>(self);
    const char *name = nullptr, *before = nullptr, *now = nullptr;
    if (sd_bus_message_read(message, "sss", &name, &before, &now) < 0 || *before == '\0') return 0;
    impl->is_there = *now != '\0';
    impl->given_up = false;
    if (impl->is_installing && !impl->done) {
      impl->End(say::update::InstallerEnded());
    } else {
      impl->Notify();
    }
    return 0;
  }

  static Message ErrorOf(sd_bus_message* message) {
    const sd_bus_error* error = sd_bus_message_get_error(message);
    const std::string text = error != nullptr ? Shown(error->message) : "";
    return text.empty() ? say::update::InstallerSilent() : Message::Verbatim(text);
  }

  /// RAUC 1.8 gives no reason over the bus, so the findings about the bundle itself are added.
  [[nodiscard]] Message WhyRefused(const Message& error) const {
    switch (state) {
      case BundleState::kDamaged:
        return say::update::Damaged(error);
      case BundleState::kWhole:
        return say::update::Untrusted(error);
      case BundleState::kUnknown:
        break;
    }
    return say::update::Refused(error);
  }

  /// RAUC has checked the bundle: its signature is valid, and these are its properties.
  static int OnInfo(sd_bus_message* message, void* self, sd_bus_error*) {
    auto* impl = static_cast<Impl*>(self);
    if (sd_bus_message_is_method_error(message, SD_BUS_ERROR_NO_REPLY) != 0) {
      // No answer about the bundle has come yet.
      impl->Refuse(ChangeResult::kFailed, sd_bus_is_open(impl->bus.get()) > 0
                                              ? say::update::InstallerSilent()
                                              : say::update::InstallerLost());
      return 0;
    }
    if (sd_bus_message_is_method_error(message, nullptr) != 0) {
      impl->Refuse(ChangeResult::kInvalid, impl->WhyRefused(ErrorOf(message)));
      return 0;
    }
    const char *compatible = nullptr, *held = nullptr;
    if (sd_bus_message_read(message, "ss", &compatible, &held) < 0) {
      impl->Refuse(ChangeResult::kFailed, say::update::AnswerUnreadable());
      return 0;
    }
    if (Shown(compatible) != impl->compatible) {
      impl->Refuse(ChangeResult::kConflict,
                   say::update::OtherMachine(Shown(compatible), impl->compatible));
      return 0;
    }
    impl->version = Shown(held);
    if (const Message why = WhyNoVersion(impl->version); !why.empty()) {
      impl->Refuse(ChangeResult::kInvalid, why);
      return 0;
    }
    if (IsOlder(impl->version, impl->options.version)) {
      impl->Refuse(ChangeResult::kConflict,
                   say::update::Older(impl->version, impl->options.version));
      return 0;
    }
    // Examining a large bundle takes time.
    if (const Message why =
            impl->options.blocking_reason ? impl->options.blocking_reason() : Message();
        !why.empty()) {
      impl->Refuse(ChangeResult::kConflict, why);
      return 0;
    }
    impl->Call();
    return 0;
  }

  void Refuse(ChangeResult result, const Message& why) {
    is_installing = false;
    outcome = last_failure = why;
    Answer(Refused(result, why));
    Notify();
  }

  /// RAUC marks the other system as bad before writing to it, so that an update installed there
  /// earlier can no longer start. The record of that update is removed before RAUC is called: after
  /// a crash in between, the page merely fails to say that a restart is needed, whereas a record
  /// that was kept would later be reported as a failed update. It stays removed if RAUC does not
  /// begin, because RAUC is then busy for another program or does not answer. A roll-back that has
  /// not been acknowledged yet is still reported.
  void Call() {
    is_called = true;
    if (last && RolledBack().empty()) ForgetLast();
    const int result =
        sd_bus_call_method_async(bus.get(), nullptr, kService, kPath, kInstaller, "InstallBundle",
                                 &Impl::OnBegun, this, "sa{sv}", file.c_str(), 0);
    if (result < 0) Refuse(ChangeResult::kFailed, say::update::InstallerUnreachable());
  }

  static int OnBegun(sd_bus_message* message, void* self, sd_bus_error*) {
    auto* impl = static_cast<Impl*>(self);
    if (sd_bus_message_is_method_error(message, nullptr) != 0) {
      impl->Refuse(ChangeResult::kFailed, say::update::NotBegun(ErrorOf(message)));
      return 0;
    }
    impl->moved_at = impl->options.now();
    impl->watch.ArmAfter(impl->options.look_every);
    impl->Answer({});
    impl->Notify();
    return 0;
  }

  /// A file that RAUC took ownership of in an earlier attempt cannot be read again, but it cannot
  /// have changed since.
  void Ask(const Finding& found) {
    if (!is_installing) return;
    if (!found.why_no_bundle.empty()) return Refuse(ChangeResult::kInvalid, found.why_no_bundle);
    state = found.state;
    if (state != BundleState::kUnknown) {
      states[file.string()] = state;
    } else if (const auto known = states.find(file.string()); known != states.end()) {
      state = known->second;
    }
    const int result = bus.get() == nullptr ? -1
                                            : sd_bus_call_method_async(
                                                  bus.get(), nullptr, kService, kPath, kInstaller,
                                                  "Info", &Impl::OnInfo, this, "s", file.c_str());
    if (result < 0) return Refuse(ChangeResult::kFailed, say::update::InstallerUnreachable());
    bus.Process();
  }
};

Updater::Updater(EventLoop& loop, UpdaterOptions options)
    : impl_(std::make_unique<Impl>(loop, std::move(options))) {}
Updater::~Updater() = default;

bool Updater::is_installing() const { return impl_->is_installing; }
bool Updater::is_free() const { return impl_->is_there && !impl_->is_installing; }

UpdateStatus Updater::status() {
  if (!impl_->is_there && std::chrono::steady_clock::now() - impl_->looked_at >= kLookAgain) {
    if (impl_->bus.get() == nullptr) {
      impl_->Connect();
    } else {
      impl_->Look();
      impl_->bus.Process();
    }
  }
  UpdateStatus status;
  status.supported = impl_->is_there;
  status.failure = impl_->is_installing ? Message() : impl_->last_failure;
  status.restart_needed =
      impl_->last && !impl_->is_installing && impl_->last->boot == impl_->options.boot;
  status.rolled_back = impl_->RolledBack();
  if (!status.supported) {
    status.message = impl_->outcome.empty() ? say::update::NoInstallerPackages() : impl_->outcome;
    return status;
  }
  status.message = impl_->is_installing ? impl_->step : impl_->outcome;
  status.slot = impl_->slot;
  status.installing = impl_->is_installing;
  status.fraction = impl_->fraction;
  status.bundles = impl_->folder.List();
  return status;
}

void Updater::Add(const std::filesystem::path& file, const std::string& name, Done done) {
  impl_->Add(file, name, done);
}

Change Updater::Remove(const std::string& name) {
  if (impl_->is_installing)
    return Refused(ChangeResult::kConflict, say::update::InstallingThis(impl_->bundle));
  Change change = impl_->folder.Remove(name);
  if (change.result == ChangeResult::kDone) impl_->ForgetBundle(name);
  return change;
}

void Updater::ForgetRollBack() {
  if (impl_->RolledBack().empty()) return;
  impl_->ForgetLast();
  impl_->Notify();
}

void Updater::Install(const std::string& name, Done done) { impl_->Install(name, std::move(done)); }

void Updater::InstallCopy(const std::filesystem::path& copy, const std::string& name, Done done) {
  impl_->InstallCopy(copy, name, std::move(done));
}

void Updater::DropCopy(const std::filesystem::path& copy) { impl_->RemoveCopy(copy); }

}  // namespace plumb
