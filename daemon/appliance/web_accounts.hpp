// The page's services for accounts, displays in the room and the audit log.
#pragma once

#include "daemon/appliance/store_access.hpp"
#include "web/service/account_service.hpp"
#include "web/service/audit_log.hpp"
#include "web/service/display_service.hpp"

namespace plumb {

/// Its arguments are borrowed.
class WebAccounts : public web::AccountService {
 public:
  explicit WebAccounts(StoreAccess& store) : store_(store) {}

  [[nodiscard]] std::string WhyUnreadable() override;
  [[nodiscard]] std::vector<web::User> Users() override;
  [[nodiscard]] std::optional<web::User> FindUser(const std::string& name) override;
  void AddUser(const web::Actor& actor, const web::User& user, web::Done done) override;
  void ChangeUser(const web::Actor& actor, const web::UserChange& change, web::Done done) override;
  [[nodiscard]] web::Preferences PreferencesOf(const std::string& name) override;
  void SetPreferences(const web::Actor& actor, const web::Preferences& preferences,
                      web::Done done) override;

 private:
  StoreAccess& store_;
};

/// Its arguments are borrowed.
class WebDisplays : public web::DisplayService {
 public:
  explicit WebDisplays(StoreAccess& store) : store_(store) {}

  [[nodiscard]] std::vector<web::Display> Displays() override;
  void AddDisplay(const web::Actor& actor, const web::Display& display, web::Done done) override;
  void RemoveDisplay(const web::Actor& actor, const std::string& id, web::Done done) override;

 private:
  StoreAccess& store_;
};

/// Its arguments are borrowed.
class WebAuditLog : public web::AuditLog {
 public:
  explicit WebAuditLog(StoreAccess& store) : store_(store) {}

  void Log(const web::Actor& actor, const std::string& action, const std::string& subject,
           const std::string& detail) override;
  [[nodiscard]] std::vector<web::AuditEntry> Audit(const web::AuditQuery& query) override;
  [[nodiscard]] std::string ExportAudit() override;

 private:
  StoreAccess& store_;
};

}  // namespace plumb
