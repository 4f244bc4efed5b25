// SPDX-License-Identifier: Apache-2.0
#include "daemon/appliance/room_in_use.hpp"

#include <chrono>
#include <cmath>
#include <ctime>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/base/units.hpp"
#include "algo/comparison/room_board.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/sheets/marker_sheet.hpp"
#include "words/room.hpp"

namespace plumb {
namespace {

constexpr int kVersionsShown = 20;

web::RoomBoardScan ForPage(const BoardScan& scan) {
  web::RoomBoardScan shown{
      .check_id = scan.check_id, .time = scan.time, .user = scan.user, .fault = scan.fault};
  if (!scan.scan) return shown;
  const BoardFit& board = scan.scan->board;
  shown.num_markers = board.num_markers;
  shown.rms_mm = board.rms_m / kMillimetre;
  shown.scale_percent = 100 * board.scale;
  shown.shift_uncertainty_mm = board.shift_uncertainty_m / kMillimetre;
  shown.turn_uncertainty_deg = board.turn_uncertainty_rad / kDegree;
  return shown;
}

web::RoomCalibrationVersion ForPage(const SignedRoom& room) {
  return {.version = room.version,
          .signed_at = room.signed_at,
          .signed_by = room.signed_by,
          .digest = room.digest,
          .shift_mm = room.fit.shift_m / kMillimetre,
          .turn_deg = room.fit.turn_rad / kDegree,
          .check_ids = room.check_ids};
}

}  // namespace

Message WhyTooOld(WallClock::time_point signed_at, WallClock::time_point now, double most_days) {
  using Days = std::chrono::duration<double, std::ratio<86400>>;
  const double age_days = Days(now - signed_at).count();
  if (most_days <= 0 || age_days <= most_days) return {};
  return say::room::TooOld(std::floor(age_days), most_days);
}

std::optional<ImportedRoom> UnlessTooOld(std::optional<ImportedRoom> room,
                                         WallClock::time_point now, double most_days) {
  if (!room || !room->room) return room;
  const Message old = WhyTooOld(room->room->signed_at, now, most_days);
  if (old.empty()) return room;
  room->room.reset();
  room->why_not = say::room::ElsewhereTooOld(room->unit, old);
  return room;
}

WallClock::time_point StartOfDay() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  ::localtime_r(&now, &local);
  local.tm_hour = local.tm_min = local.tm_sec = 0;
  local.tm_isdst = -1;  // summer time may have begun or ended since midnight
  return WallClock::from_time_t(std::mktime(&local));
}

RoomInUse::RoomInUse(const CurrentStore& store, const Config& config,
                     std::function<SensorSnapshot()> sensor)
    : store_(store), config_(config), sensor_(std::move(sensor)) {}

void RoomInUse::Refresh() {
  Room room;
  room.configured = config_.compare.T_iec_reference;
  if (store_ != nullptr) {
    try {
      room.calibration = store_->room.Newest();
      if (room.calibration) room.due = store_->room.WhyDue(*room.calibration, config_.check);
    } catch (const std::exception& error) {  // the orientation of the room is then unknown
      room.calibration.reset();
      room.due = MessageOf(error);
    }
  }
  const std::lock_guard lock(mutex_);
  if (!room.due.empty() && !(room.due == room_.due))
    Log(LogLevel::kWarning,
        fmt::format("the room has to be calibrated again: {}", room.due.English()));
  room_ = std::move(room);
}

std::optional<RoomAxes> RoomInUse::OfJob() const {
  if (room_.calibration)
    return RoomAxes{room_.calibration->version,
                    room_.calibration->fit.markers_iec,
                    room_.due,
                    room_.calibration->fit.U95_m(),
                    room_.calibration->fit.U95_rad(),
                    WhyTooOld(room_.calibration->signed_at, WallClock::now(),
                              config_.appliance.room_max_age_days)};
  if (!room_.due.empty()) return RoomAxes{0, {}, room_.due};
  return std::nullopt;
}

/// A signed calibration takes precedence even while it is due, and the axes are then unknown. The
/// configuration counts only where no calibration was ever signed.
std::optional<Pose> RoomInUse::T_iec_reference() const {
  if (!room_.due.empty()) return std::nullopt;
  return room_.calibration ? room_.calibration->fit.T_iec_reference : room_.configured;
}

std::optional<Pose> RoomInUse::AxesIn(const MarkerMap& scene) const {
  const std::lock_guard lock(mutex_);
  if (!room_.due.empty()) return std::nullopt;
  return room_.calibration ? RoomOf(room_.calibration->fit.markers_iec, scene) : room_.configured;
}

std::optional<RoomWays> RoomInUse::In(const MarkerMap& scene) const {
  const std::optional<Pose> T_iec_scene = AxesIn(scene);
  return T_iec_scene ? std::optional(WaysOfRoom(*T_iec_scene)) : std::nullopt;
}

std::optional<Eigen::Vector3d> RoomInUse::LasersIn(const MarkerMap& scene) const {
  const std::lock_guard lock(mutex_);
  if (!room_.due.empty() || !room_.calibration) return std::nullopt;
  const std::optional<Pose> T_iec_scene = RoomOf(room_.calibration->fit.markers_iec, scene);
  return T_iec_scene ? std::optional<Eigen::Vector3d>(T_iec_scene->inverse().translation())
                     : std::nullopt;
}

void RoomInUse::Report(Status& status) const {
  if (!room_.due.empty()) status.warnings.push_back(say::room::CalibrateAgain(room_.due));
  if ((room_.calibration || !room_.due.empty()) && room_.configured)
    status.warnings.push_back(say::room::ConfigurationIgnored());
  const std::optional<Pose> room = T_iec_reference();
  const Eigen::Matrix3d R_iec_reference = room.value_or(Pose::Identity()).linear();
  if (room_.due.empty() && room_.calibration) {
    if (const Message old = WhyTooOld(room_.calibration->signed_at, WallClock::now(),
                                      config_.appliance.room_max_age_days);
        !old.empty())
      status.warnings.push_back(say::room::TooOldForPlans(old));
  }
  status.room = {.gantry_xy = {R_iec_reference(1, 0), R_iec_reference(1, 1)},
                 .right_xy = {R_iec_reference(0, 0), R_iec_reference(0, 1)},
                 .is_known = room.has_value()};
}

std::pair<std::string, WallClock::time_point> RoomInUse::ScansWanted() const {
  return {sensor_().sensor.serial, StartOfDay()};
}

web::RoomCalibrationStatus RoomInUse::Calibration() const {
  const RoomCalibrationLimits limits;
  web::RoomCalibrationStatus status;
  status.num_wanted = limits.num_scans;
  status.max_shift_mm = limits.max_shift_m / kMillimetre;
  status.max_turn_deg = limits.max_turn_rad / kDegree;
  {
    const std::lock_guard lock(mutex_);
    status.due = room_.due;
    status.is_configured = room_.configured.has_value();
  }
  for (const SignedRoom& room : store_->room.List(kVersionsShown))
    status.versions.push_back(ForPage(room));
  const auto [serial, since] = ScansWanted();
  const RoomCandidate candidate = store_->room.Candidate(serial, since);
  for (const BoardScan& scan : candidate.scans) status.scans.push_back(ForPage(scan));
  if (candidate.fit) {
    status.shift_mm = candidate.fit->shift_m / kMillimetre;
    status.turn_deg = candidate.fit->turn_rad / kDegree;
  }
  status.why_not_sign = candidate.why_not;
  status.digest = candidate.digest;
  return status;
}

std::string RoomInUse::BoardPdf() const {
  const StreamInfo info = sensor_().info;
  const MarkerSheet sheet({.dictionary = info.room_markers.dictionary,
                           .ids = {},
                           .length_m = info.room_markers.length_m,
                           .is_board = true});
  return sheet.Pdf();
}

}  // namespace plumb
