// SPDX-License-Identifier: Apache-2.0
#include "daemon/database/couch_store.hpp"

#include <optional>

#include "daemon/database/row_digests.hpp"
#include "daemon/database/store_json.hpp"
#include "daemon/database/store_refusal.hpp"
#include "web/model/wall_clock.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

CouchProfile ReadCouchFrom(Database& database) {
  RequireRow(database, RowKind::kSetting, "couch");
  const std::optional<std::string> stored =
      database.FirstText("SELECT value FROM settings WHERE name = 'couch'");
  return stored ? ParseCouch(*stored) : CouchProfile{};
}

}  // namespace

CouchProfile CouchStore::Get() { return ReadCouchFrom(*database_.ForRows()); }

std::string CouchStore::Sign(const Actor& actor, const CouchProfile& wanted) {
  StoreChange change(database_);
  const CouchProfile before = ReadCouchFrom(*change);
  if (before.version != wanted.version)
    throw StoreRefusal(ChangeResult::kConflict, say::store::CouchChanged());
  CouchProfile couch = wanted;
  couch.version = before.version + 1;
  couch.signed_by = actor.user;
  couch.signed_at = WallClock::now();
  const std::string text = CouchJson(couch);
  change->Run(
      "INSERT INTO settings (name, value) VALUES ('couch', ?1) ON CONFLICT (name) DO UPDATE SET "
      "value = ?1",
      text);
  const std::string version = std::to_string(couch.version);
  change.Log(actor, "couch.set", version,
             say::store::LogCouch(couch.name, couch.num_axes, CouchAxisOf(couch, 0).unit,
                                  CouchNotes(couch)));
  change.Commit();
  return version;
}

}  // namespace plumb
