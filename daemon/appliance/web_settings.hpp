// The page's service for settings and templates.
#pragma once

#include "daemon/appliance/store_access.hpp"
#include "web/service/settings_service.hpp"

namespace plumb {

/// Its arguments are borrowed.
class WebSettings : public web::SettingsService {
 public:
  explicit WebSettings(StoreAccess& store) : store_(store) {}

  [[nodiscard]] web::Settings GetSettings() override;
  void ChangeSettings(const web::Actor& actor, const web::SettingsChange& change,
                      web::Done done) override;
  [[nodiscard]] std::vector<web::PlanTemplate> Templates() override;
  void SetTemplate(const web::Actor& actor, const web::PlanTemplate& wanted,
                   web::Done done) override;
  void RemoveTemplate(const web::Actor& actor, const std::string& site, web::Done done) override;

 private:
  StoreAccess& store_;
};

}  // namespace plumb
