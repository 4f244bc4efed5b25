// SPDX-License-Identifier: Apache-2.0
#include "daemon/records/settings_store.hpp"

#include "daemon/database/store_json.hpp"
#include "daemon/database/store_refusal.hpp"
#include "daemon/records/clock_doubt.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

constexpr const char* kStoredSettings = "SELECT value FROM settings WHERE name = 'settings'";

}  // namespace

Settings SettingsStore::Get() {
  const std::optional<std::string> stored = database_.ForRows()->FirstText(kStoredSettings);
  return stored ? ParseSettings(*stored) : first_;
}

bool SettingsStore::AreSaved() { return database_.ForRows()->Has(kStoredSettings); }

void SettingsStore::Change(const Actor& actor, const Settings& settings) {
  StoreChange change(database_);
  const std::string text = SettingsJson(settings);
  const std::string stored = change->FirstText(kStoredSettings).value_or("");
  change->Run(
      "INSERT INTO settings (name, value) VALUES ('settings', ?1) ON CONFLICT (name) DO UPDATE "
      "SET value = ?1",
      text);
  TrustClock(*change);  // the person has seen the date
  change.Log(actor, "settings.change", "", Message::Verbatim(SettingsChanges(stored, settings)));
  change.Commit();
}

std::vector<PlanTemplate> TemplateStore::List() {
  return database_.ForRows()->All(
      "SELECT site, width_mm, height_mm, shift_mm, rotation_deg, changed_by FROM templates ORDER "
      "BY site LIMIT 100",
      [](const Statement& row) {
        return PlanTemplate{.site = row.Text(0),
                            .width_mm = row.Real(1),
                            .height_mm = row.Real(2),
                            .tolerance = {.shift_mm = row.Real(3), .rotation_deg = row.Real(4)},
                            .changed_by = row.Text(5)};
      });
}

void TemplateStore::Set(const Actor& actor, const PlanTemplate& wanted) {
  constexpr std::int64_t kMaxTemplates = 100;
  StoreChange change(database_);
  if (change->FirstInteger("SELECT count(*) FROM templates WHERE site <> ?", wanted.site) >=
      kMaxTemplates)
    throw StoreRefusal(ChangeResult::kConflict, say::store::TemplatesFull());
  Message values = say::store::LogTemplateValues(
      wanted.width_mm, wanted.height_mm, wanted.tolerance.shift_mm, wanted.tolerance.rotation_deg);
  const std::optional<Message> before = change->First(
      "SELECT width_mm, height_mm, shift_mm, rotation_deg FROM templates WHERE site = ?",
      [](const Statement& row) {
        return say::store::LogTemplateValues(row.Real(0), row.Real(1), row.Real(2), row.Real(3));
      },
      wanted.site);
  change->Run(
      "INSERT INTO templates (site, width_mm, height_mm, shift_mm, rotation_deg, changed_by) "
      "VALUES (?1, ?2, ?3, ?4, ?5, ?6) ON CONFLICT (site) DO UPDATE SET site = ?1, width_mm = "
      "?2, height_mm = ?3, shift_mm = ?4, rotation_deg = ?5, changed_by = ?6",
      wanted.site, wanted.width_mm, wanted.height_mm, wanted.tolerance.shift_mm,
      wanted.tolerance.rotation_deg, actor.user);
  change.Log(actor, "template.set", "",
             before ? say::store::LogTemplateChanged(wanted.site, std::move(values), *before)
                    : say::store::LogTemplate(wanted.site, std::move(values)));
  change.Commit();
}

void TemplateStore::Remove(const Actor& actor, const std::string& site) {
  StoreChange change(database_);
  change->Run("DELETE FROM templates WHERE site = ?", site);
  if (change->num_changed() == 0)
    throw StoreRefusal(ChangeResult::kNotFound, say::store::NoTemplate());
  change.Log(actor, "template.remove", "", Message::Verbatim(site));
  change.Commit();
}

}  // namespace plumb
