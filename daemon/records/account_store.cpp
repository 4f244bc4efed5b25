#include "daemon/records/account_store.hpp"

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "daemon/records/store_refusal.hpp"
#include "daemon/records/stored_values.hpp"

namespace plumb {

using store::FromStored;
using store::Now;

namespace {

constexpr const char* kUserColumns =
    "SELECT name, role, password_hash, disabled, created_at FROM users ";

/// An account whose role cannot be read is disabled, not left out: if no account were found, the
/// page would offer to create the first one.
User ReadUser(const Statement& row) {
  User user{.name = row.Text(0),
            .role = Role::kTechnician,
            .password_hash = row.Text(2),
            .disabled = row.Integer(3) != 0,
            .created_at = FromStored(row.Integer(4))};
  try {
    user.role = store::Parse<Role>("role", row.Text(1));
  } catch (const DataError&) {
    user.disabled = true;
  }
  return user;
}

}  // namespace

std::vector<User> UserStore::List() {
  const StoreDatabase::Held rows = database_.ForRows();
  static const std::string kSql = std::string(kUserColumns) + "ORDER BY name LIMIT 1000";
  Statement query = rows->Prepare(kSql.c_str());
  std::vector<User> users;
  while (query.Step()) users.push_back(ReadUser(query));
  return users;
}

std::optional<User> UserStore::Find(const std::string& name) {
  const StoreDatabase::Held rows = database_.ForRows();
  static const std::string kSql = std::string(kUserColumns) + "WHERE name = ?";
  Statement query = rows->Prepare(kSql.c_str());
  return query.Bind(name).Step() ? std::optional(ReadUser(query)) : std::nullopt;
}

void UserStore::Add(const Actor& actor, const User& user) {
  StoreChange change(database_);
  try {
    change
        .Prepare(
            "INSERT INTO users (name, role, password_hash, disabled, created_at) VALUES (?, ?, ?, "
            "?, ?)")
        .Bind(user.name)
        .Bind(Name(user.role))
        .Bind(user.password_hash)
        .Bind(std::int64_t{user.disabled})
        .Bind(Now())
        .Run();
  } catch (const ConstraintBroken&) {
    throw StoreRefusal(ChangeResult::kConflict,
                       "there is an account of this name already: choose another name");
  }
  change.Log(actor, "user.add", user.name, std::string(Name(user.role)));
  change.Commit();
}

void UserStore::Change(const Actor& actor, const UserChange& wanted) {
  StoreChange change(database_);
  User user;
  {
    static const std::string kSql = std::string(kUserColumns) + "WHERE name = ?";
    Statement query = change.Prepare(kSql.c_str());
    if (!query.Bind(wanted.name).Step())
      throw StoreRefusal(ChangeResult::kNotFound, "there is no such account");
    user = ReadUser(query);
  }
  if (wanted.expected_hash && (user.disabled || user.password_hash != *wanted.expected_hash))
    throw StoreRefusal(ChangeResult::kConflict,
                       "the account has been changed by somebody else meanwhile: log in again");
  std::string changes;
  if (wanted.role && *wanted.role != user.role)
    changes += fmt::format("role {} > {} ", Name(user.role), Name(*wanted.role));
  if (wanted.password_hash && *wanted.password_hash != user.password_hash) changes += "password ";
  if (wanted.disabled && *wanted.disabled != user.disabled)
    changes += *wanted.disabled ? "disabled " : "enabled ";
  change.Prepare("UPDATE users SET role = ?, password_hash = ?, disabled = ? WHERE name = ?")
      .Bind(Name(wanted.role.value_or(user.role)))
      .Bind(wanted.password_hash.value_or(user.password_hash))
      .Bind(std::int64_t{wanted.disabled.value_or(user.disabled)})
      .Bind(wanted.name)
      .Run();
  {
    Statement query =
        change.Prepare("SELECT 1 FROM users WHERE role = 'engineer' AND disabled = 0 LIMIT 1");
    if (!query.Step())
      throw StoreRefusal(ChangeResult::kConflict,
                         "no enabled engineer would be left: make another one first");
  }
  if (!changes.empty()) changes.pop_back();
  change.Log(actor, "user.change", wanted.name, changes);
  change.Commit();
}

Preferences UserStore::PreferencesOf(const std::string& name) {
  const StoreDatabase::Held rows = database_.ForRows();
  Statement query = rows->Prepare("SELECT language, theme FROM preferences WHERE user = ?");
  if (!query.Bind(name).Step()) return {};
  return {.language = query.Text(0), .theme = query.Text(1)};
}

void UserStore::SetPreferences(const std::string& name, const Preferences& preferences) {
  StoreChange change(database_);
  try {
    change.Prepare("INSERT OR REPLACE INTO preferences (user, language, theme) VALUES (?, ?, ?)")
        .Bind(name)
        .Bind(preferences.language)
        .Bind(preferences.theme)
        .Run();
  } catch (const ConstraintBroken&) {  // a display in the room is no account
    throw StoreRefusal(ChangeResult::kNotFound, "there is no such account");
  }
  change.Commit();
}

using store::ParseId;

namespace {

void Insert(StoreChange& change, const Actor& actor, const Display& display) {
  change
      .Prepare("INSERT INTO displays (name, token_hash, paired_at, paired_by) VALUES (?, ?, ?, ?)")
      .Bind(display.name)
      .Bind(display.token_hash)
      .Bind(Now())
      .Bind(actor.user)
      .Run();
}

}  // namespace

std::vector<Display> DisplayStore::List() {
  const StoreDatabase::Held rows = database_.ForRows();
  Statement query = rows->Prepare(
      "SELECT id, name, token_hash, paired_at, paired_by FROM displays ORDER BY id LIMIT 100");
  std::vector<Display> displays;
  while (query.Step()) {
    displays.push_back({.id = query.Text(0),
                        .name = query.Text(1),
                        .token_hash = query.Text(2),
                        .paired_at = FromStored(query.Integer(3)),
                        .paired_by = query.Text(4)});
  }
  return displays;
}

std::string DisplayStore::Add(const Actor& actor, const Display& display) {
  StoreChange change(database_);
  Insert(change, actor, display);
  const std::string id = std::to_string(change.last_id());
  change.Log(actor, "display.pair", display.name, "");
  change.Commit();
  return id;
}

bool DisplayStore::AddProvisioned(const Display& display) {
  StoreChange change(database_);
  // Not in the table of displays, so that the key stays known when its display is removed.
  change.Prepare("INSERT OR IGNORE INTO settings (name, value) VALUES (?, ?)")
      .Bind("display-key " + display.token_hash)
      .Bind(display.name)
      .Run();
  if (change.num_changed() == 0) return false;
  {
    Statement query = change.Prepare("SELECT COUNT(*) FROM displays");
    if (query.Step() && query.Integer(0) >= static_cast<std::int64_t>(kMaxDisplays))
      throw StoreRefusal(ChangeResult::kConflict,
                         fmt::format("{} screens are paired already", kMaxDisplays));
  }
  Insert(change, store::kSelf, display);
  change.Log(store::kSelf, "display.provision", display.name, "");
  change.Commit();
  return true;
}

void DisplayStore::Remove(const Actor& actor, const std::string& id) {
  StoreChange change(database_);
  std::string name;
  {
    Statement query = change.Prepare("DELETE FROM displays WHERE id = ? RETURNING name");
    if (!query.Bind(ParseId(id)).Step())
      throw StoreRefusal(ChangeResult::kNotFound, "there is no such display");
    name = query.Text(0);
  }
  change.Log(actor, "display.remove", name, "");
  change.Commit();
}

}  // namespace plumb
