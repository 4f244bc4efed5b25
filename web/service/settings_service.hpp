// Settings of the appliance, and templates of plans.
#pragma once

#include <string>
#include <vector>

#include "web/service/change.hpp"
#include "web/service/service_types.hpp"

namespace plumb::web {

/// The rules of services.hpp hold.
class SettingsService {
 public:
  virtual ~SettingsService() = default;

  [[nodiscard]] virtual Settings GetSettings() = 0;
  virtual void ChangeSettings(const Actor& actor, const Settings& settings,
                              Done done) = 0;                       ///< kInvalid names the field.
  [[nodiscard]] virtual std::vector<PlanTemplate> Templates() = 0;  ///< By site.
  /// Replaces the template of that site; at most 100 sites.
  virtual void SetTemplate(const Actor& actor, const PlanTemplate& wanted, Done done) = 0;
  virtual void RemoveTemplate(const Actor& actor, const std::string& site, Done done) = 0;
};

}  // namespace plumb::web
