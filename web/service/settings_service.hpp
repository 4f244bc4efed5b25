// Settings of the appliance, and templates of plans.
#pragma once

#include <string>
#include <vector>

#include "web/service/change.hpp"
#include "web/service/service_types.hpp"
#include "web/service/settings_change.hpp"

namespace plumb::web {

/// The rules of services.hpp hold.
class SettingsService {
 public:
  virtual ~SettingsService() = default;

  [[nodiscard]] virtual Settings GetSettings() = 0;
  /// kInvalid names the field. Settings that are not part of the change keep what is stored when it
  /// is made.
  virtual void ChangeSettings(const Actor& actor, const SettingsChange& change, Done done) = 0;
  [[nodiscard]] virtual std::vector<PlanTemplate> Templates() = 0;  ///< By site.
  /// Replaces the template of that site; at most 100 sites.
  virtual void SetTemplate(const Actor& actor, const PlanTemplate& wanted, Done done) = 0;
  virtual void RemoveTemplate(const Actor& actor, const std::string& site, Done done) = 0;
};

}  // namespace plumb::web
