#include "daemon/records/display_store.hpp"

#include <fmt/format.h>

#include "daemon/records/store_refusal.hpp"
#include "daemon/records/stored_values.hpp"

namespace plumb {

using store::FromStored;
using store::Now;
using store::ParseId;
using web::ChangeResult;

namespace {

void Insert(StoreChange& change, const web::Actor& actor, const web::Display& display) {
  change
      .Prepare("INSERT INTO displays (name, token_hash, paired_at, paired_by) VALUES (?, ?, ?, ?)")
      .Bind(display.name)
      .Bind(display.token_hash)
      .Bind(Now())
      .Bind(actor.user)
      .Run();
}

}  // namespace

std::vector<web::Display> DisplayStore::List() {
  const StoreDatabase::Held rows = database_.ForRows();
  Statement query = rows->Prepare(
      "SELECT id, name, token_hash, paired_at, paired_by FROM displays ORDER BY id LIMIT 100");
  std::vector<web::Display> displays;
  while (query.Step()) {
    displays.push_back({.id = query.Text(0),
                        .name = query.Text(1),
                        .token_hash = query.Text(2),
                        .paired_at = FromStored(query.Integer(3)),
                        .paired_by = query.Text(4)});
  }
  return displays;
}

std::string DisplayStore::Add(const web::Actor& actor, const web::Display& display) {
  StoreChange change(database_);
  Insert(change, actor, display);
  const std::string id = std::to_string(change.last_id());
  change.Log(actor, "display.pair", display.name, "");
  change.Commit();
  return id;
}

bool DisplayStore::AddProvisioned(const web::Display& display) {
  StoreChange change(database_);
  // Not in the table of displays, so that the key stays known when its display is removed.
  change.Prepare("INSERT OR IGNORE INTO settings (name, value) VALUES (?, ?)")
      .Bind("display-key " + display.token_hash)
      .Bind(display.name)
      .Run();
  if (change.num_changed() == 0) return false;
  {
    Statement query = change.Prepare("SELECT COUNT(*) FROM displays");
    if (query.Step() && query.Integer(0) >= static_cast<std::int64_t>(web::kMaxDisplays))
      throw StoreRefusal(ChangeResult::kConflict,
                         fmt::format("{} screens are paired already", web::kMaxDisplays));
  }
  Insert(change, store::kSelf, display);
  change.Log(store::kSelf, "display.provision", display.name, "");
  change.Commit();
  return true;
}

void DisplayStore::Remove(const web::Actor& actor, const std::string& id) {
  StoreChange change(database_);
  std::string name;
  {
    Statement query = change.Prepare("DELETE FROM displays WHERE id = ? RETURNING name");
    if (!query.Bind(ParseId(id)).Step())
      throw StoreRefusal(ChangeResult::kNotFound, "there is no such display");
    name = query.Text(0);
  }
  change.Log(actor, "display.remove", name, "");
  change.Commit();
}

}  // namespace plumb
