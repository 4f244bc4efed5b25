// SPDX-License-Identifier: Apache-2.0
#include "daemon/records/settings_store.hpp"

#include <utility>

#include "daemon/database/clock_doubt.hpp"
#include "daemon/database/row_digests.hpp"
#include "daemon/database/store_json.hpp"
#include "daemon/database/store_refusal.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

constexpr const char* kStoredSettings = "SELECT value FROM settings WHERE name = 'settings'";

constexpr const char* kTemplateColumns =
    "SELECT site, width_mm, height_mm, shift_mm, rotation_deg, changed_by, posture, hint FROM "
    "templates ";

PlanTemplate ReadTemplate(const Statement& row) {
  return {.site = row.Text(0),
          .width_mm = row.Real(1),
          .height_mm = row.Real(2),
          .tolerance = {.shift_mm = row.Real(3), .rotation_deg = row.Real(4)},
          .changed_by = row.Text(5),
          .posture = row.Text(6),
          .hint = row.Text(7)};
}

Message ValuesForLog(const PlanTemplate& one) {
  Message values = say::store::LogTemplateValues(
      one.width_mm, one.height_mm, one.tolerance.shift_mm, one.tolerance.rotation_deg);
  if (one.posture.empty() && one.hint.empty()) return values;
  return say::store::LogTemplateWords(std::move(values), one.posture, one.hint);
}

}  // namespace

Settings SettingsStore::Get() {
  const StoreDatabase::Held rows = database_.ForRows();
  RequireRow(*rows, RowKind::kSetting, "settings");
  const std::optional<std::string> stored = rows->FirstText(kStoredSettings);
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
  const StoreDatabase::Held rows = database_.ForRows();
  RequireRows(*rows, RowKind::kTemplate);
  return rows->All(std::string(kTemplateColumns) + "ORDER BY site LIMIT 100", ReadTemplate);
}

void TemplateStore::Set(const Actor& actor, const PlanTemplate& wanted) {
  constexpr std::int64_t kMaxTemplates = 100;
  StoreChange change(database_);
  if (change->FirstInteger("SELECT count(*) FROM templates WHERE site <> ?", wanted.site) >=
      kMaxTemplates)
    throw StoreRefusal(ChangeResult::kConflict, say::store::TemplatesFull());
  Message values = ValuesForLog(wanted);
  const std::optional<Message> before = change->First(
      std::string(kTemplateColumns) + "WHERE site = ?",
      [](const Statement& row) { return ValuesForLog(ReadTemplate(row)); }, wanted.site);
  change->Run(
      "INSERT INTO templates (site, width_mm, height_mm, shift_mm, rotation_deg, changed_by, "
      "posture, hint) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8) ON CONFLICT (site) DO UPDATE SET "
      "site = ?1, width_mm = ?2, height_mm = ?3, shift_mm = ?4, rotation_deg = ?5, changed_by = "
      "?6, posture = ?7, hint = ?8",
      wanted.site, wanted.width_mm, wanted.height_mm, wanted.tolerance.shift_mm,
      wanted.tolerance.rotation_deg, actor.user, wanted.posture, wanted.hint);
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
