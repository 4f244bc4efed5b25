// SPDX-License-Identifier: Apache-2.0
// The settings that a person changes on the page, and the templates of plans, one for each
// treatment site.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "daemon/database/store_database.hpp"
#include "web/model/account.hpp"
#include "web/model/patient.hpp"
#include "web/model/settings.hpp"

namespace plumb {

/// Thread-safe. @throws IoError and its kinds; DataError for settings that cannot be read.
class SettingsStore {
 public:
  /// @param first  In force until somebody saves settings.
  explicit SettingsStore(StoreDatabase& database, Settings first = {})
      : database_(database), first_(std::move(first)) {}

  [[nodiscard]] Settings Get();
  /// Whether somebody has saved settings, so that the first ones no longer hold.
  [[nodiscard]] bool AreSaved();
  void Change(const Actor& actor, const Settings& settings);

 private:
  StoreDatabase& database_;
  const Settings first_;
};

/// Thread-safe. Changes throw StoreRefusal; everything throws IoError and its kinds.
class TemplateStore {
 public:
  explicit TemplateStore(StoreDatabase& database) : database_(database) {}

  [[nodiscard]] std::vector<PlanTemplate> List();  ///< By site.
  /// Replaces the template of that site. kConflict above 100 sites.
  void Set(const Actor& actor, const PlanTemplate& wanted);
  void Remove(const Actor& actor, const std::string& site);

 private:
  StoreDatabase& database_;
};

}  // namespace plumb
