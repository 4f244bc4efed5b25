// SPDX-License-Identifier: Apache-2.0
// The page's services for accounts, displays in the room and the audit log.
#include "daemon/services/web_services.hpp"

#include <utility>

#include <fmt/format.h>

#include "daemon/loop/log.hpp"

namespace plumb {

namespace {

class WebAccounts final : public web::AccountService {
 public:
  explicit WebAccounts(StoreAccess& store) : store_(store) {}

  Message WhyUnreadable() override {
    return store_.WhyUnreadable([](Store& store) { (void)store.users.List(); });
  }

  std::vector<User> Users() override {
    return store_.Read(&Store::users, [](UserStore& users) { return users.List(); });
  }

  std::optional<User> FindUser(const std::string& name) override {
    return store_.ReadOrNothing(&Store::users, [&](UserStore& users) { return users.Find(name); });
  }

  void AddUser(const Actor& actor, const User& user, Done done) override {
    store_.Write(&Store::users, std::move(done), [=](UserStore& users) { users.Add(actor, user); });
  }

  void ChangeUser(const Actor& actor, const UserChange& change, Done done) override {
    store_.Write(&Store::users, std::move(done),
                 [=](UserStore& users) { users.Change(actor, change); });
  }

  std::optional<SecondFactor> FindSecondFactor(const std::string& name) override {
    return store_.ReadOrNothing(&Store::users,
                                [&](UserStore& users) { return users.SecondFactorOf(name); });
  }

  void SetSecondFactor(const Actor& actor, const std::string& name,
                       const std::optional<SecondFactor>& expected,
                       const std::optional<SecondFactor>& wanted, const std::string& action,
                       Done done) override {
    store_.Write(&Store::users, std::move(done), [=](UserStore& users) {
      users.SetSecondFactor(actor, name, expected, wanted, action);
    });
  }

  std::optional<std::string> FindPin(const std::string& name) override {
    return store_.ReadOrNothing(&Store::users, [&](UserStore& users) { return users.PinOf(name); });
  }

  void SetPin(const Actor& actor, const std::string& name, const std::optional<std::string>& hash,
              Done done) override {
    store_.Write(&Store::users, std::move(done),
                 [=](UserStore& users) { users.SetPin(actor, name, hash); });
  }

  Preferences PreferencesOf(const std::string& name) override {
    return store_.ReadOrNothing(&Store::users,
                                [&](UserStore& users) { return users.PreferencesOf(name); });
  }

  void SetPreferences(const Actor& actor, const Preferences& preferences, Done done) override {
    store_.Write(&Store::users, std::move(done),
                 [=](UserStore& users) { users.SetPreferences(actor.user, preferences); });
  }

 private:
  StoreAccess& store_;
};

class WebDisplays final : public web::DisplayService {
 public:
  explicit WebDisplays(StoreAccess& store) : store_(store) {}

  std::vector<Display> Displays() override {
    return store_.ReadOrNothing(&Store::displays,
                                [](DisplayStore& displays) { return displays.List(); });
  }

  void AddDisplay(const Actor& actor, const Display& display, Done done) override {
    store_.Write(&Store::displays, std::move(done),
                 [=](DisplayStore& displays) { return displays.Add(actor, display); });
  }

  void RemoveDisplay(const Actor& actor, const std::string& id, Done done) override {
    store_.Write(&Store::displays, std::move(done),
                 [=](DisplayStore& displays) { displays.Remove(actor, id); });
  }

 private:
  StoreAccess& store_;
};

class WebAuditLog final : public web::AuditLog {
 public:
  explicit WebAuditLog(StoreAccess& store) : store_(store) {}

  void Log(const Actor& actor, const std::string& action, const std::string& subject,
           const Message& detail) override {
    const auto report = [action](const Change& answer) {
      if (answer.result == ChangeResult::kDone) return;
      plumb::Log(LogLevel::kError, fmt::format("cannot write '{}' to the audit log: {}", action,
                                               answer.message.English()));
    };
    store_.Write(&Store::audit, report,
                 [=](AuditStore& audit) { audit.Log(actor, action, subject, detail); });
  }

  std::vector<AuditEntry> Audit(const AuditQuery& query) override {
    return store_.Read(&Store::audit, [&](AuditStore& audit) { return audit.Find(query); });
  }

  std::string ExportAudit() override {
    return store_.Read(&Store::audit, [](AuditStore& audit) { return audit.Export(); });
  }

 private:
  StoreAccess& store_;
};

}  // namespace

std::unique_ptr<web::DisplayService> MakeWebDisplays(StoreAccess& store) {
  return std::make_unique<WebDisplays>(store);
}

std::unique_ptr<web::AccountService> MakeWebAccounts(StoreAccess& store) {
  return std::make_unique<WebAccounts>(store);
}

std::unique_ptr<web::AuditLog> MakeWebAuditLog(StoreAccess& store) {
  return std::make_unique<WebAuditLog>(store);
}

}  // namespace plumb
