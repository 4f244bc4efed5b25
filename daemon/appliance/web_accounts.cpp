#include "daemon/appliance/web_accounts.hpp"

#include <utility>

#include <fmt/format.h>

#include "daemon/loop/log.hpp"

namespace plumb {

using web::ChangeResult;

std::string WebAccounts::WhyUnreadable() {
  return store_.WhyUnreadable([](Store& store) { (void)store.users.List(); });
}

std::vector<web::User> WebAccounts::Users() {
  return store_.Read(&Store::users, [](UserStore& users) { return users.List(); });
}

std::optional<web::User> WebAccounts::FindUser(const std::string& name) {
  return store_.ReadOrNothing(&Store::users, [&](UserStore& users) { return users.Find(name); });
}

void WebAccounts::AddUser(const web::Actor& actor, const web::User& user, web::Done done) {
  store_.Change(&Store::users, std::move(done), [=](UserStore& users) { users.Add(actor, user); });
}

void WebAccounts::ChangeUser(const web::Actor& actor, const web::UserChange& change,
                             web::Done done) {
  store_.Change(&Store::users, std::move(done),
                [=](UserStore& users) { users.Change(actor, change); });
}

web::Preferences WebAccounts::PreferencesOf(const std::string& name) {
  return store_.ReadOrNothing(&Store::users,
                              [&](UserStore& users) { return users.PreferencesOf(name); });
}

void WebAccounts::SetPreferences(const web::Actor& actor, const web::Preferences& preferences,
                                 web::Done done) {
  store_.Change(&Store::users, std::move(done),
                [=](UserStore& users) { users.SetPreferences(actor.user, preferences); });
}

std::vector<web::Display> WebDisplays::Displays() {
  return store_.ReadOrNothing(&Store::displays,
                              [](DisplayStore& displays) { return displays.List(); });
}

void WebDisplays::AddDisplay(const web::Actor& actor, const web::Display& display, web::Done done) {
  store_.Change(&Store::displays, std::move(done),
                [=](DisplayStore& displays) { return displays.Add(actor, display); });
}

void WebDisplays::RemoveDisplay(const web::Actor& actor, const std::string& id, web::Done done) {
  store_.Change(&Store::displays, std::move(done),
                [=](DisplayStore& displays) { displays.Remove(actor, id); });
}

void WebAuditLog::Log(const web::Actor& actor, const std::string& action,
                      const std::string& subject, const std::string& detail) {
  const auto report = [action](const web::Change& answer) {
    if (answer.result == ChangeResult::kDone) return;
    plumb::Log(LogLevel::kError,
               fmt::format("the audit log does not take '{}': {}", action, answer.message));
  };
  store_.Change(&Store::audit, report,
                [=](AuditStore& audit) { audit.Log(actor, action, subject, detail); });
}

std::vector<web::AuditEntry> WebAuditLog::Audit(const web::AuditQuery& query) {
  return store_.Read(&Store::audit, [&](AuditStore& audit) { return audit.Find(query); });
}

std::string WebAuditLog::ExportAudit() {
  return store_.Read(&Store::audit, [](AuditStore& audit) { return audit.Export(); });
}

}  // namespace plumb
