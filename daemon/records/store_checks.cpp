// Daily checks and the baseline that they are compared with.
#include "daemon/records/check_json.hpp"
#include "daemon/records/store.hpp"
#include "daemon/records/store_internal.hpp"

namespace plumb {

using store::FromStored;
using store::ParseId;
using store::ToStored;
using web::ChangeResult;

namespace {

constexpr const char* kNewestChecks =
    "SELECT id, time, user, sensor_serial, json FROM checks ORDER BY id DESC LIMIT ?";

web::CheckRecord ReadCheck(const Statement& row) {
  web::CheckRecord record = CheckIn(row.Text(4));
  record.id = row.Text(0);
  record.time = FromStored(row.Integer(1));
  record.user = row.Text(2);
  record.sensor_serial = row.Text(3);
  return record;
}

}  // namespace

std::string Store::AddCheck(const web::Actor& actor, const std::string& sensor_serial,
                            const std::string& check_json) {
  const std::string status = CheckIn(check_json).status;
  const std::lock_guard lock(write_mutex_);
  Transaction transaction(*write_);
  write_
      ->Prepare(
          "INSERT INTO checks (time, user, sensor_serial, status, json) VALUES (?, ?, ?, ?, ?)")
      .Bind(ToStored(web::WallClock::now()))
      .Bind(actor.user)
      .Bind(sensor_serial)
      .Bind(status)
      .Bind(check_json)
      .Run();
  const std::string id = std::to_string(write_->last_id());
  Write(actor, "check.done", id, status);
  transaction.Commit();
  return id;
}

std::vector<web::CheckRecord> Store::Checks(int limit) {
  const std::lock_guard lock(list_mutex_);
  Statement query = list_->Prepare(kNewestChecks);
  query.Bind(std::int64_t{limit});
  std::vector<web::CheckRecord> checks;
  while (query.Step()) checks.push_back(ReadCheck(query));
  return checks;
}

std::optional<web::CheckRecord> Store::LastCheck() {
  const std::lock_guard lock(read_mutex_);
  Statement query = read_->Prepare(kNewestChecks);
  return query.Bind(std::int64_t{1}).Step() ? std::optional(ReadCheck(query)) : std::nullopt;
}

bool Store::HasPassedCheckSince(web::WallClock::time_point since,
                                const std::string& sensor_serial) {
  const std::lock_guard lock(read_mutex_);
  Statement query = read_->Prepare(
      "SELECT 1 FROM checks WHERE status = 'passed' AND time >= ? AND time <= ? AND (? = '' OR "
      "sensor_serial = ?) LIMIT 1");
  return query.Bind(ToStored(since))
      .Bind(ToStored(web::WallClock::now()))
      .Bind(sensor_serial)
      .Bind(sensor_serial)
      .Step();
}

bool Store::IsConfirmedByLaterCheck(const std::string& scan_id) {
  const std::optional<std::int64_t> number = ParseId(scan_id);
  if (!number) return false;
  const std::lock_guard lock(read_mutex_);
  Statement query = read_->Prepare(
      "SELECT 1 FROM scans JOIN checks ON checks.status = 'passed' AND checks.sensor_serial = "
      "scans.sensor_serial AND checks.time >= scans.finished_at AND checks.time <= ?2 AND "
      "date(checks.time / 1000000, 'unixepoch', 'localtime') = "
      "date(scans.started_at / 1000000, 'unixepoch', 'localtime') "
      "WHERE scans.id = ?1 AND scans.sensor_serial <> '' "
      "AND NOT EXISTS (SELECT 1 FROM checks AS other WHERE other.status = 'failed' AND "
      "other.sensor_serial = scans.sensor_serial AND other.time >= scans.started_at AND "
      "other.time <= checks.time) "
      "AND EXISTS (SELECT 1 FROM check_baselines WHERE set_at <= scans.started_at) "
      "AND NOT EXISTS (SELECT 1 FROM check_baselines WHERE set_at > scans.started_at AND "
      "set_at <= checks.time) LIMIT 1");
  return query.Bind(*number).Bind(ToStored(web::WallClock::now())).Step();
}

std::optional<web::CheckBaseline> Store::CheckBaseline() {
  const std::lock_guard lock(read_mutex_);
  Statement query = read_->Prepare(
      "SELECT check_id, set_at, set_by, json FROM check_baselines JOIN checks ON checks.id = "
      "check_id ORDER BY check_baselines.id DESC "
      "LIMIT 1");
  if (!query.Step()) return std::nullopt;
  return web::CheckBaseline{.check_id = query.Text(0),
                            .set_at = FromStored(query.Integer(1)),
                            .set_by = query.Text(2),
                            .num_markers = CheckIn(query.Text(3)).num_markers};
}

std::string Store::CheckBaselineJson() {
  const std::lock_guard lock(read_mutex_);
  Statement query = read_->Prepare(
      "SELECT json FROM check_baselines JOIN checks ON checks.id = check_id ORDER BY "
      "check_baselines.id DESC LIMIT 1");
  return query.Step() ? query.Text(0) : std::string();
}

void Store::SetCheckBaseline(const web::Actor& actor, const std::string& check_id) {
  const std::optional<std::int64_t> number = ParseId(check_id);
  const std::lock_guard lock(write_mutex_);
  Transaction transaction(*write_);
  {
    Statement query = write_->Prepare("SELECT json, user FROM checks WHERE id = ?");
    if (!number || !query.Bind(*number).Step())
      throw StoreRefusal(ChangeResult::kNotFound, "there is no such check");
    const auto baseline = BaselineIn(query.Text(0));
    if (!baseline || baseline->markers.size() < 3) {
      throw StoreRefusal(
          ChangeResult::kConflict,
          "this check saw fewer than 3 markers well: check again and sweep over all of them");
    }
    if (query.Text(1) == actor.user) {
      throw StoreRefusal(ChangeResult::kRefused,
                         "another person than the one who took this check sets it as the baseline");
    }
  }
  write_->Prepare("INSERT INTO check_baselines (check_id, set_at, set_by) VALUES (?, ?, ?)")
      .Bind(*number)
      .Bind(ToStored(web::WallClock::now()))
      .Bind(actor.user)
      .Run();
  Write(actor, "check.baseline", check_id, "");
  transaction.Commit();
}

}  // namespace plumb
