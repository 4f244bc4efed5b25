// SPDX-License-Identifier: Apache-2.0
#include "daemon/records/check_store.hpp"

#include "algo/base/errors.hpp"
#include "daemon/database/row_digests.hpp"
#include "daemon/database/store_refusal.hpp"
#include "daemon/database/stored_values.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

constexpr const char* kNewestChecks =
    "SELECT id, time, user, sensor_serial, json FROM checks ORDER BY id DESC LIMIT ?";

CheckRecord ReadCheck(const Statement& row) {
  CheckRecord record = CheckIn(row.Text(4));
  record.id = row.Text(0);
  record.time = FromStored(row.Integer(1));
  record.user = row.Text(2);
  record.sensor_serial = row.Text(3);
  return record;
}

}  // namespace

std::string CheckStore::Add(const Actor& actor, const std::string& sensor_serial,
                            const TakenCheck& taken) {
  const std::string status(Name(taken.check.status));
  StoreChange change(database_);
  change->Run("INSERT INTO checks (time, user, sensor_serial, status, json) VALUES (?, ?, ?, ?, ?)",
              StoredNow(), actor.user, sensor_serial, status, CheckJson(taken));
  const std::string id = std::to_string(change->last_id());
  change.Log(actor, "check.done", id, say::store::LogCheck(status));
  change.Commit();
  return id;
}

std::vector<CheckRecord> CheckStore::List(int limit) {
  return database_.ForLists()->All(kNewestChecks, ReadCheck, limit);
}

std::optional<CheckRecord> CheckStore::Last() {
  return database_.ForRows()->First(kNewestChecks, ReadCheck, 1);
}

DailyCheck CheckStore::StateSince(WallClock::time_point since, const std::string& sensor_serial) {
  const StoreDatabase::Held rows = database_.ForRows();
  // Ordered by id, not by time: the clock may have been set back between a pass and a failure.
  Statement query = rows->Prepare(
      "SELECT status = 'failed', time FROM checks WHERE (status = 'failed' AND (?1 = '' OR "
      "sensor_serial IN (?1, ''))) OR (status = 'passed' AND time <= ?2 AND (?1 = '' OR "
      "sensor_serial = ?1)) ORDER BY id DESC LIMIT 1",
      sensor_serial, StoredNow());
  if (!query.Step() || query.Integer(1) < ToStored(since)) return DailyCheck::kOverdue;
  return query.Integer(0) != 0 ? DailyCheck::kFailed : DailyCheck::kPassed;
}

bool CheckStore::ConfirmsScan(const std::string& scan_id) {
  return database_.ForRows()->Has(
      "SELECT 1 FROM scans JOIN checks ON checks.status = 'passed' AND checks.sensor_serial = "
      "scans.sensor_serial AND checks.time >= scans.finished_at AND checks.time <= ?2 AND "
      "date(checks.time / 1000000, 'unixepoch', 'localtime') = "
      "date(scans.started_at / 1000000, 'unixepoch', 'localtime') "
      "WHERE scans.id = ?1 AND scans.sensor_serial <> '' "
      "AND NOT EXISTS (SELECT 1 FROM checks AS other WHERE other.status = 'failed' AND "
      "other.sensor_serial IN (scans.sensor_serial, '') AND other.time >= scans.started_at AND "
      "other.time <= checks.time) "
      "AND EXISTS (SELECT 1 FROM check_baselines WHERE set_at <= scans.started_at) "
      "AND NOT EXISTS (SELECT 1 FROM check_baselines WHERE set_at > scans.started_at AND "
      "set_at <= checks.time) LIMIT 1",
      ParseId(scan_id), StoredNow());
}

bool CheckStore::RefutesScan(const std::string& scan_id) {
  return database_.ForRows()
             ->FirstInteger(
                 "SELECT checks.status = 'failed' FROM scans JOIN checks ON checks.time >= "
                 "scans.started_at AND (checks.sensor_serial = scans.sensor_serial OR "
                 "(checks.status = 'failed' AND checks.sensor_serial = '')) WHERE scans.id = ?1 "
                 "AND checks.status IN ('passed', 'failed') ORDER BY checks.id LIMIT 1",
                 ParseId(scan_id))
             .value_or(0) != 0;
}

std::optional<CheckBaseline> CheckStore::Baseline() {
  return database_.ForRows()->First(
      "SELECT check_id, set_at, set_by, json FROM check_baselines JOIN checks ON checks.id = "
      "check_id ORDER BY check_baselines.id DESC LIMIT 1",
      [](const Statement& row) {
        return CheckBaseline{.check_id = row.Text(0),
                             .set_at = FromStored(row.Integer(1)),
                             .set_by = row.Text(2),
                             .num_markers = CheckIn(row.Text(3)).num_markers};
      });
}

std::optional<MarkerBaseline> CheckStore::BaselineMarkers() {
  const StoreDatabase::Held rows = database_.ForRows();
  const auto newest =
      rows->First("SELECT id, check_id FROM check_baselines ORDER BY id DESC LIMIT 1",
                  [](const Statement& row) { return std::pair(row.Text(0), row.Text(1)); });
  if (newest) {
    RequireRow(*rows, RowKind::kBaseline, newest->first);
    RequireRow(*rows, RowKind::kCheck, newest->second);
  }
  const std::optional<std::string> json = rows->FirstText(
      "SELECT json FROM check_baselines JOIN checks ON checks.id = check_id ORDER BY "
      "check_baselines.id DESC LIMIT 1");
  if (!json) return std::nullopt;
  std::optional<MarkerBaseline> markers = BaselineIn(*json);
  if (!markers) throw DataError(say::store::BaselineUnreadable());
  return markers;
}

std::vector<Message> CheckStore::ChangesBy(const std::string& check_id) {
  const std::optional<MarkerBaseline> baseline = BaselineMarkers();
  const std::optional<std::string> json =
      database_.ForRows()->FirstText("SELECT json FROM checks WHERE id = ?", ParseId(check_id));
  const std::optional<MarkerBaseline> wanted = json ? BaselineIn(*json) : std::nullopt;
  return baseline && wanted ? ChangesOfBaseline(*baseline, *wanted) : std::vector<Message>();
}

void CheckStore::SetBaseline(const Actor& actor, const std::string& check_id,
                             const std::string& reason) {
  const std::optional<std::int64_t> number = ParseId(check_id);
  StoreChange change(database_);
  std::size_t num_markers = 0;
  {
    Statement query = change->Prepare("SELECT json, user FROM checks WHERE id = ?", number);
    if (!query.Step()) throw StoreRefusal(ChangeResult::kNotFound, say::store::NoCheck());
    const auto baseline = BaselineIn(query.Text(0));
    if (!baseline || baseline->markers.size() < 3) {
      throw StoreRefusal(ChangeResult::kConflict, say::store::BaselineFewMarkers());
    }
    if (query.Text(1) == actor.user) {
      throw StoreRefusal(ChangeResult::kRefused, say::store::BaselineSamePerson());
    }
    num_markers = baseline->markers.size();
  }
  Message described = say::store::LogBaseline(num_markers);
  {
    Statement query = change->Prepare(
        "SELECT check_id, json FROM check_baselines JOIN checks ON checks.id = check_id ORDER BY "
        "check_baselines.id DESC LIMIT 1");
    if (query.Step())
      described = say::store::LogBaselineChanged(num_markers, query.Text(0),
                                                 CheckIn(query.Text(1)).num_markers);
  }
  change->Run("INSERT INTO check_baselines (check_id, set_at, set_by) VALUES (?, ?, ?)", number,
              StoredNow(), actor.user);
  change.Log(actor, "check.baseline", check_id,
             say::store::LogBaselineReason(std::move(described), reason));
  change.Commit();
}

}  // namespace plumb
