// SPDX-License-Identifier: Apache-2.0
#include "daemon/records/room_store.hpp"

#include <algorithm>

#include "algo/base/errors.hpp"
#include "algo/base/units.hpp"
#include "daemon/database/row_digests.hpp"
#include "daemon/database/store_refusal.hpp"
#include "daemon/database/stored_values.hpp"
#include "daemon/records/check_json.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

constexpr int kScansShown = 6;  // scans of the board shown for one calibration
// checks since the signature that are searched for one that saw enough
constexpr int kChecksSearched = 20;

constexpr const char* kNewestRooms =
    "SELECT version, signed_at, signed_by, digest, json FROM room_calibrations ORDER BY version "
    "DESC LIMIT ?";

/// @throws DataError
SignedRoom ReadRoom(const Statement& row) {
  SignedRoom room = SignedRoomIn(row.Text(4));
  room.version = static_cast<int>(row.Integer(0));
  if (room.digest != row.Text(3)) {
    throw DataError(say::store::RoomNotAsSigned(room.version));
  }
  room.signed_at = FromStored(row.Integer(1));
  room.signed_by = row.Text(2);
  return room;
}

/// Id of the newest check that the calibration was made from. Checks are ordered by id, because the
/// clock may have been set back since the calibration was signed.
std::int64_t LastCheckOf(const SignedRoom& room) {
  std::int64_t last = 0;
  for (const std::string& id : room.check_ids) last = std::max(last, ParseId(id).value_or(0));
  return last;
}

/// 0 if there is no calibration, or if the newest one cannot be read and must be made again.
std::int64_t LastCheckUsed(Database& database) {
  try {
    const std::optional<SignedRoom> room = database.First(kNewestRooms, ReadRoom, 1);
    return room ? LastCheckOf(*room) : 0;
  } catch (const DataError&) {
    return 0;
  }
}

RoomCandidate ReadCandidate(Database& database, const std::string& serial, std::int64_t since) {
  const std::int64_t last_used = LastCheckUsed(database);
  Statement query = database.Prepare(
      "SELECT id, time, user, json FROM checks WHERE sensor_serial = ? AND time >= ? AND id > ? "
      "ORDER BY id DESC LIMIT ?",
      serial, since, last_used, kScansShown);
  std::vector<BoardScan> scans;
  while (query.Step()) {
    std::optional<BoardScan> scan = BoardScanIn(query.Text(3));
    if (!scan) continue;
    scan->check_id = query.Text(0);
    scan->time = FromStored(query.Integer(1));
    scan->user = query.Text(2);
    scans.push_back(std::move(*scan));
  }
  return RoomCandidateOf(std::move(scans));
}

}  // namespace

RoomCandidate RoomStore::Candidate(const std::string& sensor_serial, WallClock::time_point since) {
  return ReadCandidate(*database_.ForLists(), sensor_serial, ToStored(since));
}

std::optional<SignedRoom> RoomStore::Newest() {
  const StoreDatabase::Held rows = database_.ForRows();
  std::optional<SignedRoom> newest = rows->First(kNewestRooms, ReadRoom, 1);
  if (newest) RequireRow(*rows, RowKind::kRoom, std::to_string(newest->version));
  return newest;
}

std::vector<SignedRoom> RoomStore::List(int limit) {
  const StoreDatabase::Held lists = database_.ForLists();
  Statement query = lists->Prepare(kNewestRooms, limit);
  std::vector<SignedRoom> rooms;
  while (query.Step()) {
    try {
      rooms.push_back(ReadRoom(query));
    } catch (const DataError&) {  // reported where it would be used
    }
  }
  return rooms;
}

std::string RoomStore::Sign(const Actor& actor, const std::string& sensor_serial,
                            WallClock::time_point since, const std::string& digest) {
  StoreChange change(database_);
  const RoomCandidate candidate = ReadCandidate(*change, sensor_serial, ToStored(since));
  if (!candidate.why_not.empty()) throw StoreRefusal(ChangeResult::kConflict, candidate.why_not);
  if (candidate.digest != digest) {
    throw StoreRefusal(ChangeResult::kConflict, say::store::BoardScannedAgain());
  }
  const double shift_mm = candidate.fit->shift_m / kMillimetre,
               turn_deg = candidate.fit->turn_rad / kDegree;
  const Message described =
      change
          ->First("SELECT version, digest FROM room_calibrations ORDER BY version DESC LIMIT 1",
                  [&](const Statement& row) {
                    return say::store::LogRoomChanged(shift_mm, turn_deg, candidate.digest,
                                                      row.Integer(0), row.Text(1));
                  })
          .value_or(say::store::LogRoom(shift_mm, turn_deg, candidate.digest));
  change->Run(
      "INSERT INTO room_calibrations (signed_at, signed_by, digest, json) VALUES (?, ?, ?, ?)",
      StoredNow(), actor.user, candidate.digest, candidate.json);
  const std::string version = std::to_string(change->last_id());
  change.Log(actor, "room.calibrate", version, described);
  change.Commit();
  return version;
}

Message RoomStore::WhyDue(const SignedRoom& room, const MarkerCheckLimits& limits) {
  const StoreDatabase::Held rows = database_.ForRows();
  Statement query = rows->Prepare("SELECT json FROM checks WHERE id > ? ORDER BY id DESC LIMIT ?",
                                  LastCheckOf(room), kChecksSearched);
  while (query.Step()) {
    const std::optional<MarkerBaseline> seen = BaselineIn(query.Text(0));
    if (!seen) continue;
    if (const auto why = WhyRoomIsDue(room, *seen, limits)) return *why;
  }
  return {};
}

}  // namespace plumb
