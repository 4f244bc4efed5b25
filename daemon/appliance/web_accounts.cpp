#include "daemon/appliance/web_accounts.hpp"

#include <utility>

#include <fmt/format.h>

#include "daemon/loop/log.hpp"

namespace plumb {

using web::ChangeResult;

std::vector<web::User> WebAccounts::Users() {
  return store_.Read([](Store& store) { return store.Users(); });
}

std::optional<web::User> WebAccounts::FindUser(const std::string& name) {
  return store_.Read([&](Store& store) { return store.FindUser(name); });
}

void WebAccounts::AddUser(const web::Actor& actor, const web::User& user, web::Done done) {
  store_.Change(std::move(done),
                [=](Store& store) { return store.AddUser(actor, user), std::string(); });
}

void WebAccounts::ChangeUser(const web::Actor& actor, const web::UserChange& change,
                             web::Done done) {
  store_.Change(std::move(done),
                [=](Store& store) { return store.ChangeUser(actor, change), std::string(); });
}

std::vector<web::Display> WebDisplays::Displays() {
  return store_.Read([](Store& store) { return store.Displays(); });
}

void WebDisplays::AddDisplay(const web::Actor& actor, const web::Display& display, web::Done done) {
  store_.Change(std::move(done), [=](Store& store) { return store.AddDisplay(actor, display); });
}

void WebDisplays::RemoveDisplay(const web::Actor& actor, const std::string& id, web::Done done) {
  store_.Change(std::move(done),
                [=](Store& store) { return store.RemoveDisplay(actor, id), std::string(); });
}

void WebAuditLog::Log(const web::Actor& actor, const std::string& action,
                      const std::string& subject, const std::string& detail) {
  const auto report = [action](const web::Change& answer) {
    if (answer.result == ChangeResult::kDone) return;
    plumb::Log(LogLevel::kError,
               fmt::format("the audit log does not take '{}': {}", action, answer.message));
  };
  store_.Change(report, [=](Store& store) {
    return store.Log(actor, action, subject, detail), std::string();
  });
}

std::vector<web::AuditEntry> WebAuditLog::Audit(const web::AuditQuery& query) {
  return store_.Read([&](Store& store) { return store.Audit(query); });
}

}  // namespace plumb
