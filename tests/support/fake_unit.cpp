// SPDX-License-Identifier: Apache-2.0
// FakeAppliance: accounts, screens, audit log, settings, backups and updates.
#include "tests/support/fake_appliance.hpp"

#include <fmt/format.h>
#include <strings.h>

#include <algorithm>
#include <fstream>

#include "words/backup.hpp"

namespace plumb::test {

using namespace web;  // NOLINT: a test's own names are none of these

void FakeAppliance::AddDisplay(const Actor& actor, const Display& display, Done done) {
  displays.push_back(display);
  displays.back().id = fmt::format("d{:04}", next_id_++);
  Did(actor, "display.pair", display.name, done, displays.back().id);
}

void FakeAppliance::RemoveDisplay(const Actor& actor, const std::string& id, Done done) {
  const auto found = std::ranges::find(displays, id, &Display::id);
  if (found == displays.end())
    return Finish(done, Refused(ChangeResult::kNotFound, "no such display"));
  const std::string name = found->name;
  displays.erase(found);
  Did(actor, "display.remove", name, done);
}

void FakeAppliance::MakeBackup(const Actor& actor, Done done) {
  if (!backup_fault.empty()) return Finish(done, Refused(ChangeResult::kInvalid, backup_fault));
  const Message made = say::backup::LogMade("/backups/one", 3, 20, 1000, 0);
  Log(actor, "backup.make", "", encrypts_backups ? say::backup::LogEncrypted(made) : made);
  Notify(web::EventKind::kData);
  Finish(done, DoneWith(""));
}

std::optional<User> FakeAppliance::FindUser(const std::string& name) {
  const auto found =
      std::find_if(users.begin(), users.end(), [&](const User& user) { return user.name == name; });
  return found == users.end() ? std::nullopt : std::optional(*found);
}

void FakeAppliance::AddUser(const Actor& actor, const User& user, Done done) {
  if (FindUser(user.name))
    return Finish(done, Refused(ChangeResult::kConflict, "this name is taken"));
  users.push_back(user);
  Did(actor, "user.add", user.name, done);
}

void FakeAppliance::SetSecondFactor(const Actor& actor, const std::string& name,
                                    const std::optional<SecondFactor>& expected,
                                    const std::optional<SecondFactor>& wanted,
                                    const std::string& action, Done done) {
  if (FindSecondFactor(name) != expected)
    return Finish(done, Refused(ChangeResult::kConflict,
                                "the account has been changed by somebody else meanwhile"));
  if (wanted) {
    second_factors[name] = *wanted;
  } else {
    second_factors.erase(name);
  }
  for (User& user : users)
    if (user.name == name) user.has_second_factor = wanted.has_value();
  if (action.empty()) return Finish(done, {});
  Did(actor, action, name, done);
}

void FakeAppliance::SetPin(const Actor& actor, const std::string& name,
                           const std::optional<std::string>& hash, Done done) {
  pins.erase(name);
  if (hash) pins[name] = *hash;
  Did(actor, hash ? "user.pin_set" : "user.pin_removed", name, done);
}

void FakeAppliance::SetPreferences(const Actor& actor, const Preferences& preferences, Done done) {
  preferences_[actor.user] = preferences;
  if (status.session && status.session->opened_by == actor.user) {
    status.session->language = preferences.language;
    Notify(EventKind::kStatus);
  }
  Finish(done, {});
}

void FakeAppliance::ChangeUser(const Actor& actor, const UserChange& change, Done done) {
  const auto found = std::find_if(users.begin(), users.end(),
                                  [&](const User& other) { return other.name == change.name; });
  if (found == users.end()) return Finish(done, Refused(ChangeResult::kNotFound, "no such user"));
  if (change.expected_hash && (found->disabled || found->password_hash != *change.expected_hash))
    return Finish(done, Refused(ChangeResult::kConflict,
                                "the account has been changed by somebody else meanwhile"));
  User user = *found;
  user.role = change.role.value_or(user.role);
  user.disabled = change.disabled.value_or(user.disabled);
  user.password_hash = change.password_hash.value_or(user.password_hash);
  const bool engineer_left = std::any_of(users.begin(), users.end(), [&](const User& other) {
    const User& after = other.name == user.name ? user : other;
    return after.role == Role::kEngineer && !after.disabled;
  });
  if (!engineer_left)
    return Finish(done, Refused(ChangeResult::kConflict, "one engineer must remain"));
  *found = user;
  Did(actor, "user.change", user.name, done);
}

void FakeAppliance::Log(const Actor& actor, const std::string& action, const std::string& subject,
                        const Message& detail) {
  audit.push_back({static_cast<std::int64_t>(audit.size()) + 1, WallClock::now(), actor.user,
                   actor.address, action, subject, detail});
}

std::vector<AuditEntry> FakeAppliance::Audit(const AuditQuery& query) {
  std::vector<AuditEntry> found;
  for (auto entry = audit.rbegin();
       entry != audit.rend() && found.size() < static_cast<std::size_t>(query.limit); ++entry) {
    const bool is_view = entry->action.starts_with("view.");
    if ((query.before == 0 || entry->number < query.before) && (query.views || !is_view) &&
        entry->action.starts_with(query.actions)) {
      found.push_back(*entry);
      found.back().about = SubjectOf(*entry);
    }
  }
  return found;
}

void FakeAppliance::ChangeSettings(const Actor& actor, const SettingsChange& change, Done done) {
  settings = change.AppliedTo(settings);
  Notify(EventKind::kStatus);
  Did(actor, "settings.change", "", done);
}

bool FakeAppliance::RunInBackground(web::BackgroundPool where, std::function<void()> job,
                                    std::function<void()> done) {
  if (refuse_background_work) {
    ++num_refused_background_work;
    asked_for_background_work.release();
    return false;
  }
  const auto both = [job = std::move(job), done = std::move(done)] {
    job();
    done();
  };
  if (hold_background_work && hold_only.value_or(where) == where) {
    held_background_work.push_back(both);
    asked_for_background_work.release();
  } else {
    both();
  }
  return true;
}

void FakeAppliance::AddBundle(const Actor& actor, const std::filesystem::path& file,
                              const std::string& name, Done done) {
  std::ifstream in(file, std::ios::binary);
  std::string magic(4, ' ');
  in.read(magic.data(), 4);
  if (magic != "hsqs")
    return Finish(done, Refused(ChangeResult::kInvalid,
                                name + " is not a bundle: expected a squashfs image"));
  uploaded_bytes = std::filesystem::file_size(file);
  update.bundles.push_back(name);
  Notify(EventKind::kUpdate);
  Did(actor, "update.upload", name, done);
}

void FakeAppliance::RemoveBundle(const Actor& actor, const std::string& name, Done done) {
  if (std::erase(update.bundles, name) == 0)
    return Finish(done, Refused(ChangeResult::kNotFound, "there is no such bundle"));
  Notify(EventKind::kUpdate);
  Did(actor, "update.remove", name, done);
}

void FakeAppliance::InstallUpdate(const Actor& actor, const std::string& bundle, Done done) {
  if (status.scan)
    return Finish(done, Refused(ChangeResult::kConflict, "a scan is running; update after it"));
  if (!update.supported) return Finish(done, Refused(ChangeResult::kConflict, update.message));
  update.installing = true;
  update.fraction = 0.4;
  update.message = Message::Verbatim("Copying image to rootfs.1");
  Notify(EventKind::kUpdate);
  Did(actor, "update.install", bundle, done);
}

void FakeAppliance::InstallFromStick(const Actor& actor, const std::string& bundle, Done done) {
  if (std::find(stick.begin(), stick.end(), bundle) == stick.end())
    return Finish(done, Refused(ChangeResult::kNotFound, "no USB stick with it is plugged in"));
  if (std::find(update.bundles.begin(), update.bundles.end(), bundle) == update.bundles.end())
    update.bundles.push_back(bundle);
  InstallUpdate(actor, bundle, done);
}

void FakeAppliance::RestartSystem(const Actor& actor, Done done) {
  const auto refuse = [&](const char* why) { Finish(done, Refused(ChangeResult::kConflict, why)); };
  if (update.installing) return refuse("a system update is being installed: wait until it is done");
  if (status.scan) return refuse("a scan is running: wait for its result");
  if (status.session) return refuse("the session of a patient is open: close it first");
  ++num_restarts;
  Did(actor, "system.restart", "", done);
}

void FakeAppliance::ResetToFactory(const Actor& actor, FactoryReset kind, Done done) {
  if (status.session)
    return Finish(done, Refused(ChangeResult::kConflict,
                                "the session of a patient is open: close it first, then restart"));
  factory_reset = kind;
  Did(actor, "system.factory_reset_request", "", done);
}

void FakeAppliance::ForgetRollBack(const Actor& actor, Done done) {
  status.rolled_back = {};
  update.rolled_back = {};
  Notify(EventKind::kUpdate);
  Notify(EventKind::kStatus);
  Did(actor, "update.seen", "", done);
}

void FakeAppliance::SendTestMessage(const Actor& actor, Done done) {
  if (status.messages.empty())
    return Finish(done, Refused(ChangeResult::kInvalid, "no messages are set up"));
  for (const MessageWay& way : status.messages)
    if (!way.failure.empty()) return Finish(done, Refused(ChangeResult::kFailed, way.failure));
  for (MessageWay& way : status.messages) ++way.sent;
  Did(actor, "messages.test", "", done);
}

void FakeAppliance::WriteDiagnostics(const Actor& actor, Done done) {
  Log(actor, "diagnostics.write", "", {});
  Finish(done, {ChangeResult::kDone, {}, "", diagnostics_file});
}

}  // namespace plumb::test
