// Accounts, the audit log, settings.
#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "daemon/records/store.hpp"
#include "daemon/records/store_internal.hpp"
#include "daemon/records/store_json.hpp"

namespace plumb {

using store::FromStored;
using store::ToStored;
using web::ChangeResult;

namespace {

/// An account whose role cannot be read is closed, not left out: where no account is seen at all,
/// the page offers to make the first one.
web::User ReadUser(const Statement& row) {
  web::User user{.name = row.Text(0),
                 .role = web::Role::kTechnician,
                 .password_hash = row.Text(2),
                 .disabled = row.Integer(3) != 0,
                 .created_at = FromStored(row.Integer(4))};
  try {
    user.role = store::ParseRole(row.Text(1));
  } catch (const DataError&) {
    user.disabled = true;
  }
  return user;
}

}  // namespace

std::vector<web::User> Store::Users() {
  const std::lock_guard lock(read_mutex_);
  Statement query = read_->Prepare(
      "SELECT name, role, password_hash, disabled, created_at FROM users ORDER BY name LIMIT 1000");
  std::vector<web::User> users;
  while (query.Step()) users.push_back(ReadUser(query));
  return users;
}

std::optional<web::User> Store::FindUser(const std::string& name) {
  const std::lock_guard lock(read_mutex_);
  Statement query = read_->Prepare(
      "SELECT name, role, password_hash, disabled, created_at FROM users WHERE name = ?");
  return query.Bind(name).Step() ? std::optional(ReadUser(query)) : std::nullopt;
}

void Store::AddUser(const web::Actor& actor, const web::User& user) {
  const std::lock_guard lock(write_mutex_);
  Transaction transaction(*write_);
  try {
    write_
        ->Prepare(
            "INSERT INTO users (name, role, password_hash, disabled, created_at) VALUES (?, ?, ?, "
            "?, ?)")
        .Bind(user.name)
        .Bind(store::Name(user.role))
        .Bind(user.password_hash)
        .Bind(std::int64_t{user.disabled})
        .Bind(ToStored(web::WallClock::now()))
        .Run();
  } catch (const ConstraintBroken&) {
    throw StoreRefusal(ChangeResult::kConflict,
                       "there is an account of this name already: choose another name");
  }
  Write(actor, "user.add", user.name, store::Name(user.role));
  transaction.Commit();
}

void Store::ChangeUser(const web::Actor& actor, const web::UserChange& change) {
  const std::lock_guard lock(write_mutex_);
  Transaction transaction(*write_);
  web::User user;
  {
    Statement query = write_->Prepare(
        "SELECT name, role, password_hash, disabled, created_at FROM users WHERE name = ?");
    if (!query.Bind(change.name).Step())
      throw StoreRefusal(ChangeResult::kNotFound, "there is no such account");
    user = ReadUser(query);
  }
  if (change.expected_hash && (user.disabled || user.password_hash != *change.expected_hash))
    throw StoreRefusal(ChangeResult::kConflict,
                       "the account has been changed by somebody else meanwhile: log in again");
  std::string changes;
  if (change.role && *change.role != user.role)
    changes += fmt::format("role {} ", store::Name(*change.role));
  if (change.password_hash && *change.password_hash != user.password_hash) changes += "password ";
  if (change.disabled && *change.disabled != user.disabled)
    changes += *change.disabled ? "disabled " : "enabled ";
  write_->Prepare("UPDATE users SET role = ?, password_hash = ?, disabled = ? WHERE name = ?")
      .Bind(store::Name(change.role.value_or(user.role)))
      .Bind(change.password_hash.value_or(user.password_hash))
      .Bind(std::int64_t{change.disabled.value_or(user.disabled)})
      .Bind(change.name)
      .Run();
  {
    Statement query =
        write_->Prepare("SELECT 1 FROM users WHERE role = 'engineer' AND disabled = 0 LIMIT 1");
    if (!query.Step())
      throw StoreRefusal(ChangeResult::kConflict,
                         "no enabled engineer would be left: make another one first");
  }
  if (!changes.empty()) changes.pop_back();
  Write(actor, "user.change", change.name, changes);
  transaction.Commit();
}

void Store::Log(const web::Actor& actor, const std::string& action, const std::string& subject,
                const std::string& detail) {
  const std::lock_guard lock(write_mutex_);
  Transaction transaction(*write_);
  Write(actor, action, subject, detail);
  transaction.Commit();
}

std::vector<web::AuditEntry> Store::Audit(const web::AuditQuery& wanted) {
  const std::lock_guard lock(list_mutex_);
  Statement query = list_->Prepare(
      "SELECT number, time, user, address, action, subject, detail FROM audit WHERE (?1 <= 0 OR "
      "number < ?1) AND substr(action, 1, length(?2)) = ?2 AND (?3 OR substr(action, 1, 5) <> "
      "'view.') ORDER BY number DESC LIMIT ?4");
  query.Bind(wanted.before).Bind(wanted.actions).Bind(std::int64_t{wanted.views});
  query.Bind(std::int64_t{wanted.limit});
  std::vector<web::AuditEntry> entries;
  while (query.Step()) {
    entries.push_back({.number = query.Integer(0),
                       .time = FromStored(query.Integer(1)),
                       .user = query.Text(2),
                       .address = query.Text(3),
                       .action = query.Text(4),
                       .subject = query.Text(5),
                       .detail = query.Text(6)});
  }
  return entries;
}

std::vector<web::PlanTemplate> Store::Templates() {
  const std::lock_guard lock(read_mutex_);
  Statement query = read_->Prepare(
      "SELECT site, width_mm, height_mm, shift_mm, rotation_deg, changed_by FROM templates ORDER "
      "BY site LIMIT 100");
  std::vector<web::PlanTemplate> templates;
  while (query.Step()) {
    templates.push_back({.site = query.Text(0),
                         .width_mm = query.Real(1),
                         .height_mm = query.Real(2),
                         .tolerance = {.shift_mm = query.Real(3), .rotation_deg = query.Real(4)},
                         .changed_by = query.Text(5)});
  }
  return templates;
}

void Store::SetTemplate(const web::Actor& actor, const web::PlanTemplate& wanted) {
  constexpr std::int64_t kMaxTemplates = 100;
  const std::lock_guard lock(write_mutex_);
  Transaction transaction(*write_);
  {
    Statement query = write_->Prepare("SELECT count(*) FROM templates WHERE site <> ?");
    if (query.Bind(wanted.site).Step() && query.Integer(0) >= kMaxTemplates)
      throw StoreRefusal(ChangeResult::kConflict,
                         "there are templates of 100 sites already: remove one first");
  }
  write_
      ->Prepare(
          "INSERT INTO templates (site, width_mm, height_mm, shift_mm, rotation_deg, changed_by) "
          "VALUES (?1, ?2, ?3, ?4, ?5, ?6) ON CONFLICT (site) DO UPDATE SET site = ?1, width_mm = "
          "?2, height_mm = ?3, shift_mm = ?4, rotation_deg = ?5, changed_by = ?6")
      .Bind(wanted.site)
      .Bind(wanted.width_mm)
      .Bind(wanted.height_mm)
      .Bind(wanted.tolerance.shift_mm)
      .Bind(wanted.tolerance.rotation_deg)
      .Bind(actor.user)
      .Run();
  Write(actor, "template.set", "",
        fmt::format("{}: region {:g} x {:g} mm, tolerance {:g} mm and {:g} degrees", wanted.site,
                    wanted.width_mm, wanted.height_mm, wanted.tolerance.shift_mm,
                    wanted.tolerance.rotation_deg));
  transaction.Commit();
}

void Store::RemoveTemplate(const web::Actor& actor, const std::string& site) {
  const std::lock_guard lock(write_mutex_);
  Transaction transaction(*write_);
  write_->Prepare("DELETE FROM templates WHERE site = ?").Bind(site).Run();
  if (write_->num_changed() == 0)
    throw StoreRefusal(ChangeResult::kNotFound, "there is no template of this site");
  Write(actor, "template.remove", "", site);
  transaction.Commit();
}

web::Settings Store::GetSettings() {
  const std::lock_guard lock(read_mutex_);
  Statement query = read_->Prepare("SELECT value FROM settings WHERE name = 'settings'");
  return query.Step() ? ParseSettings(query.Text(0)) : web::Settings{};
}

void Store::ChangeSettings(const web::Actor& actor, const web::Settings& settings) {
  const std::lock_guard lock(write_mutex_);
  Transaction transaction(*write_);
  const std::string text = SettingsJson(settings);
  write_
      ->Prepare(
          "INSERT INTO settings (name, value) VALUES ('settings', ?1) ON CONFLICT (name) DO UPDATE "
          "SET value = ?1")
      .Bind(text)
      .Run();
  Write(actor, "settings.change", "", text);
  transaction.Commit();
}

}  // namespace plumb
