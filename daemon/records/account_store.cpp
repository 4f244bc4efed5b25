// SPDX-License-Identifier: Apache-2.0
#include "daemon/records/account_store.hpp"

#include <sstream>
#include <utility>

#include "algo/base/errors.hpp"
#include "daemon/database/row_digests.hpp"
#include "daemon/database/store_refusal.hpp"
#include "daemon/database/stored_values.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

const std::string kUserColumns =
    "SELECT name, role, password_hash, disabled, created_at, "
    "EXISTS (SELECT 1 FROM second_factors WHERE user = name) FROM users ";

/// An account whose role cannot be read is disabled, not left out: if no account were found, the
/// page would offer to create the first one.
User ReadUser(const Statement& row) {
  User user{.name = row.Text(0),
            .role = Role::kTechnician,
            .password_hash = row.Text(2),
            .disabled = row.Integer(3) != 0,
            .created_at = FromStored(row.Integer(4)),
            .has_second_factor = row.Integer(5) != 0};
  try {
    user.role = ParseStored<Role>("role", row.Text(1));
  } catch (const DataError&) {
    user.disabled = true;
  }
  return user;
}

/// The hashes of recovery codes are stored one a line.
SecondFactor ReadSecondFactor(const Statement& row) {
  SecondFactor factor{.secret = row.Text(0), .last_step = row.Integer(1), .recovery_hashes = {}};
  std::istringstream hashes(row.Text(2));
  for (std::string hash; std::getline(hashes, hash);) factor.recovery_hashes.push_back(hash);
  return factor;
}

constexpr const char* kSecondFactorOf =
    "SELECT secret, last_step, recovery FROM second_factors WHERE user = ?";

}  // namespace

std::vector<User> UserStore::List() {
  const StoreDatabase::Held rows = database_.ForRows();
  RequireRows(*rows, RowKind::kAccount);
  return rows->All(kUserColumns + "ORDER BY name LIMIT 1000", ReadUser);
}

std::optional<User> UserStore::Find(const std::string& name) {
  const StoreDatabase::Held rows = database_.ForRows();
  RequireRow(*rows, RowKind::kAccount, name);
  return rows->First(kUserColumns + "WHERE name = ?", ReadUser, name);
}

void UserStore::Add(const Actor& actor, const User& user) {
  StoreChange change(database_);
  try {
    change->Run(
        "INSERT INTO users (name, role, password_hash, disabled, created_at) VALUES (?, ?, ?, "
        "?, ?)",
        user.name, Name(user.role), user.password_hash, user.disabled, StoredNow());
  } catch (const ConstraintBroken&) {
    throw StoreRefusal(ChangeResult::kConflict, say::store::AccountExists());
  }
  change.Log(actor, "user.add", user.name, say::store::LogRole(Name(user.role)));
  change.Commit();
}

void UserStore::Change(const Actor& actor, const UserChange& wanted) {
  StoreChange change(database_);
  RequireRow(*change, RowKind::kAccount, wanted.name);
  const std::optional<User> found =
      change->First(kUserColumns + "WHERE name = ?", ReadUser, wanted.name);
  if (!found) throw StoreRefusal(ChangeResult::kNotFound, say::store::NoAccount());
  const User& user = *found;
  if (wanted.expected_hash && (user.disabled || user.password_hash != *wanted.expected_hash))
    throw StoreRefusal(ChangeResult::kConflict, say::store::AccountChanged());
  std::vector<Message> changes;
  if (wanted.role && *wanted.role != user.role)
    changes.push_back(say::store::LogRoleChange(say::store::LogRole(Name(user.role)),
                                                say::store::LogRole(Name(*wanted.role))));
  if (wanted.password_hash && *wanted.password_hash != user.password_hash)
    changes.push_back(say::store::LogPassword());
  if (wanted.disabled && *wanted.disabled != user.disabled)
    changes.push_back(*wanted.disabled ? say::store::LogDisabled() : say::store::LogEnabled());
  change->Run("UPDATE users SET role = ?, password_hash = ?, disabled = ? WHERE name = ?",
              Name(wanted.role.value_or(user.role)),
              wanted.password_hash.value_or(user.password_hash),
              wanted.disabled.value_or(user.disabled), wanted.name);
  if (!change->Has("SELECT 1 FROM users WHERE role = 'engineer' AND disabled = 0 LIMIT 1"))
    throw StoreRefusal(ChangeResult::kConflict, say::store::NoEngineerLeft());
  change.Log(actor, "user.change", wanted.name,
             changes.empty() ? Message() : say::store::LogUserChange(std::move(changes)));
  change.Commit();
}

std::optional<SecondFactor> UserStore::SecondFactorOf(const std::string& name) {
  const StoreDatabase::Held rows = database_.ForRows();
  RequireRow(*rows, RowKind::kAccount, name);
  return rows->First(kSecondFactorOf, ReadSecondFactor, name);
}

void UserStore::SetSecondFactor(const Actor& actor, const std::string& name,
                                const std::optional<SecondFactor>& expected,
                                const std::optional<SecondFactor>& wanted,
                                const std::string& action) {
  StoreChange change(database_);
  RequireRow(*change, RowKind::kAccount, name);
  if (!change->Has("SELECT 1 FROM users WHERE name = ?", name))
    throw StoreRefusal(ChangeResult::kNotFound, say::store::NoAccount());
  if (change->First(kSecondFactorOf, ReadSecondFactor, name) != expected)
    throw StoreRefusal(ChangeResult::kConflict, say::store::AccountChanged());
  if (wanted) {
    std::string hashes;
    for (const std::string& hash : wanted->recovery_hashes) hashes += hash + "\n";
    change->Run(
        "INSERT OR REPLACE INTO second_factors (user, secret, last_step, recovery) "
        "VALUES (?, ?, ?, ?)",
        name, wanted->secret, wanted->last_step, hashes);
  } else {
    change->Run("DELETE FROM second_factors WHERE user = ?", name);
  }
  if (!action.empty()) change.Log(actor, action, name, {});
  change.Commit();
}

std::optional<std::string> UserStore::PinOf(const std::string& name) {
  const StoreDatabase::Held rows = database_.ForRows();
  RequireRow(*rows, RowKind::kAccount, name);
  return rows->First(
      "SELECT hash FROM pins WHERE user = ?", [](const Statement& row) { return row.Text(0); },
      name);
}

void UserStore::SetPin(const Actor& actor, const std::string& name,
                       const std::optional<std::string>& hash) {
  StoreChange change(database_);
  RequireRow(*change, RowKind::kAccount, name);
  if (!change->Has("SELECT 1 FROM users WHERE name = ?", name))
    throw StoreRefusal(ChangeResult::kNotFound, say::store::NoAccount());
  if (hash) {
    change->Run("INSERT OR REPLACE INTO pins (user, hash) VALUES (?, ?)", name, *hash);
  } else {
    change->Run("DELETE FROM pins WHERE user = ?", name);
  }
  change.Log(actor, hash ? "user.pin_set" : "user.pin_removed", name, {});
  change.Commit();
}

Preferences UserStore::PreferencesOf(const std::string& name) {
  const auto read = [](const Statement& row) {
    return Preferences{.language = row.Text(0), .theme = row.Text(1)};
  };
  return database_.ForRows()
      ->First("SELECT language, theme FROM preferences WHERE user = ?", read, name)
      .value_or(Preferences{});
}

void UserStore::SetPreferences(const std::string& name, const Preferences& preferences) {
  StoreChange change(database_);
  try {
    change->Run("INSERT OR REPLACE INTO preferences (user, language, theme) VALUES (?, ?, ?)", name,
                preferences.language, preferences.theme);
  } catch (const ConstraintBroken&) {  // a display in the room is no account
    throw StoreRefusal(ChangeResult::kNotFound, say::store::NoAccount());
  }
  change.Commit();
}

namespace {

void Insert(StoreChange& change, const Actor& actor, const Display& display) {
  change->Run("INSERT INTO displays (name, token_hash, paired_at, paired_by) VALUES (?, ?, ?, ?)",
              display.name, display.token_hash, StoredNow(), actor.user);
}

}  // namespace

std::vector<Display> DisplayStore::List() {
  const StoreDatabase::Held rows = database_.ForRows();
  RequireRows(*rows, RowKind::kDisplay);
  return rows->All(
      "SELECT id, name, token_hash, paired_at, paired_by FROM displays ORDER BY id LIMIT 100",
      [](const Statement& row) {
        return Display{.id = row.Text(0),
                       .name = row.Text(1),
                       .token_hash = row.Text(2),
                       .paired_at = FromStored(row.Integer(3)),
                       .paired_by = row.Text(4)};
      });
}

std::string DisplayStore::Add(const Actor& actor, const Display& display) {
  StoreChange change(database_);
  Insert(change, actor, display);
  const std::string id = std::to_string(change->last_id());
  change.Log(actor, "display.pair", display.name, {});
  change.Commit();
  return id;
}

bool DisplayStore::AddProvisioned(const Display& display) {
  StoreChange change(database_);
  // Not in the table of displays, so that the key stays known when its display is removed.
  change->Run("INSERT OR IGNORE INTO settings (name, value) VALUES (?, ?)",
              "display-key " + display.token_hash, display.name);
  if (change->num_changed() == 0) return false;
  if (change->FirstInteger("SELECT COUNT(*) FROM displays") >=
      static_cast<std::int64_t>(kMaxDisplays))
    throw StoreRefusal(ChangeResult::kConflict, say::store::DisplaysFull(kMaxDisplays));
  Insert(change, kSelf, display);
  change.Log(kSelf, "display.provision", display.name, {});
  change.Commit();
  return true;
}

void DisplayStore::Remove(const Actor& actor, const std::string& id) {
  StoreChange change(database_);
  const std::optional<std::string> name =
      change->FirstText("DELETE FROM displays WHERE id = ? RETURNING name", ParseId(id));
  if (!name) throw StoreRefusal(ChangeResult::kNotFound, say::store::NoDisplay());
  change.Log(actor, "display.remove", *name, {});
  change.Commit();
}

}  // namespace plumb
