#include "daemon/records/settings_store.hpp"

#include "daemon/records/store_json.hpp"

namespace plumb {

web::Settings SettingsStore::Get() {
  const StoreDatabase::Held rows = database_.ForRows();
  Statement query = rows->Prepare("SELECT value FROM settings WHERE name = 'settings'");
  return query.Step() ? ParseSettings(query.Text(0)) : web::Settings{};
}

void SettingsStore::Change(const web::Actor& actor, const web::Settings& settings) {
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

}  // namespace plumb
