#include "daemon/records/settings_store.hpp"

#include <fmt/format.h>

#include "daemon/records/store_json.hpp"
#include "daemon/records/store_refusal.hpp"

namespace plumb {

Settings SettingsStore::Get() {
  const StoreDatabase::Held rows = database_.ForRows();
  Statement query = rows->Prepare("SELECT value FROM settings WHERE name = 'settings'");
  return query.Step() ? ParseSettings(query.Text(0)) : Settings{};
}

void SettingsStore::Change(const Actor& actor, const Settings& settings) {
  StoreChange change(database_);
  const std::string text = SettingsJson(settings);
  std::string stored;
  if (Statement query = change.Prepare("SELECT value FROM settings WHERE name = 'settings'");
      query.Step())
    stored = query.Text(0);
  change
      .Prepare(
          "INSERT INTO settings (name, value) VALUES ('settings', ?1) ON CONFLICT (name) DO UPDATE "
          "SET value = ?1")
      .Bind(text)
      .Run();
  change.Log(actor, "settings.change", "", SettingsChanges(stored, settings));
  change.Commit();
}

namespace {

std::string Described(double width_mm, double height_mm, double shift_mm, double rotation_deg) {
  return fmt::format("region {:g} x {:g} mm, tolerance {:g} mm and {:g} degrees", width_mm,
                     height_mm, shift_mm, rotation_deg);
}

}  // namespace

std::vector<PlanTemplate> TemplateStore::List() {
  const StoreDatabase::Held rows = database_.ForRows();
  Statement query = rows->Prepare(
      "SELECT site, width_mm, height_mm, shift_mm, rotation_deg, changed_by FROM templates ORDER "
      "BY site LIMIT 100");
  std::vector<PlanTemplate> templates;
  while (query.Step()) {
    templates.push_back({.site = query.Text(0),
                         .width_mm = query.Real(1),
                         .height_mm = query.Real(2),
                         .tolerance = {.shift_mm = query.Real(3), .rotation_deg = query.Real(4)},
                         .changed_by = query.Text(5)});
  }
  return templates;
}

void TemplateStore::Set(const Actor& actor, const PlanTemplate& wanted) {
  constexpr std::int64_t kMaxTemplates = 100;
  StoreChange change(database_);
  {
    Statement query = change.Prepare("SELECT count(*) FROM templates WHERE site <> ?");
    if (query.Bind(wanted.site).Step() && query.Integer(0) >= kMaxTemplates)
      throw StoreRefusal(ChangeResult::kConflict,
                         "there are templates of 100 sites already: remove one first");
  }
  std::string before;
  {
    Statement query = change.Prepare(
        "SELECT width_mm, height_mm, shift_mm, rotation_deg FROM templates WHERE site = ?");
    if (query.Bind(wanted.site).Step())
      before = "; before: " + Described(query.Real(0), query.Real(1), query.Real(2), query.Real(3));
  }
  change
      .Prepare(
          "INSERT INTO templates (site, width_mm, height_mm, shift_mm, rotation_deg, changed_by) "
          "VALUES (?1, ?2, ?3, ?4, ?5, ?6) ON CONFLICT (site) DO UPDATE SET site = ?1, width_mm = "
          "?2, height_mm = ?3, shift_mm = ?4, rotation_deg = ?5, changed_by = ?6")
      .Bind(wanted.site)
      .Bind(wanted.width_mm)
      .Bind(wanted.height_mm)
      .Bind(wanted.tolerance.shift_mm)
      .Bind(wanted.tolerance.rotation_deg)
      .Bind(actor.user)
      .Run();
  change.Log(actor, "template.set", "",
             fmt::format("{}: {}{}", wanted.site,
                         Described(wanted.width_mm, wanted.height_mm, wanted.tolerance.shift_mm,
                                   wanted.tolerance.rotation_deg),
                         before));
  change.Commit();
}

void TemplateStore::Remove(const Actor& actor, const std::string& site) {
  StoreChange change(database_);
  change.Prepare("DELETE FROM templates WHERE site = ?").Bind(site).Run();
  if (change.num_changed() == 0)
    throw StoreRefusal(ChangeResult::kNotFound, "there is no template of this site");
  change.Log(actor, "template.remove", "", site);
  change.Commit();
}

}  // namespace plumb
