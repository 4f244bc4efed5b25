// SPDX-License-Identifier: Apache-2.0
// The room and its sensor: the daily check of the markers, the room's calibration, which defines
// the axes of the room, and the profile of the sensor unit.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "web/model/account.hpp"
#include "web/model/change.hpp"
#include "web/model/check.hpp"
#include "web/model/couch.hpp"
#include "web/model/sensor_profile.hpp"
#include "web/model/wall_clock.hpp"

namespace plumb::web {

/// The rules of services.hpp hold.
class CheckService {
 public:
  virtual ~CheckService() = default;

  [[nodiscard]] virtual CheckStatus GetChecks() = 0;  ///< (background)
  /// The next scan, from any button, is a check of the room's markers. kConflict during a scan.
  virtual void OpenCheck(const Actor& actor, Done done) = 0;
  /// Gives up a check that was opened: the next scan belongs to the open session again. kConflict
  /// during a scan, and if no check is open.
  virtual void LeaveCheck(const Actor& actor, Done done) = 0;
  /// Sets this check as the baseline. kRefused for the user who took it.
  virtual void SetCheckBaseline(const Actor& actor, const std::string& check_id,
                                const std::string& reason, Done done) = 0;
};

/// One check scan that saw the board.
struct RoomBoardScan {
  std::string check_id;
  WallClock::time_point time;
  std::string user;
  Message fault;  ///< Why it cannot be used; empty if it can.
  std::size_t num_markers = 0;
  double rms_mm = 0.0;
  double scale_percent = 100.0;
  /// Half-widths of the 95 % intervals, from this scan alone.
  double shift_uncertainty_mm = 0.0;
  double turn_uncertainty_deg = 0.0;
};

/// A signed calibration.
struct RoomCalibrationVersion {
  int version = 0;
  WallClock::time_point signed_at;
  std::string signed_by;
  std::string digest;     ///< SHA-256, hexadecimal.
  double shift_mm = 0.0;  ///< Spread of its scans.
  double turn_deg = 0.0;
  std::vector<std::string> check_ids;
};

struct RoomCalibrationStatus {
  std::vector<RoomCalibrationVersion> versions;  ///< Newest first; the first one is in use.
  /// Why comparisons do not use it: a marker has moved since, or it cannot be read.
  Message due;
  bool is_configured = false;  ///< [iec] T_iec_reference is set; it is used only without a version.
  /// Since the last version, of today and this sensor; newest first.
  std::vector<RoomBoardScan> scans;
  std::size_t num_wanted = 3;      ///< Number of scans required.
  std::optional<double> shift_mm;  ///< Spread of the scans so far.
  std::optional<double> turn_deg;
  double max_shift_mm = 0.0;
  double max_turn_deg = 0.0;
  Message why_not_sign;  ///< Empty if it may be signed.
  std::string digest;    ///< Digest of the calibration that would be signed.
};

/// Of the room and its couch. The rules of services.hpp hold.
class RoomCalibrationService {
 public:
  virtual ~RoomCalibrationService() = default;

  [[nodiscard]] virtual RoomCalibrationStatus GetRoomCalibration() = 0;  ///< Aside.
  /// @param digest  Digest of the calibration that was read and is signed; kConflict if another one
  ///         would be stored, or if it may not be signed. Returns the version.
  virtual void SignRoomCalibration(const Actor& actor, const std::string& digest, Done done) = 0;
  /// The couch from now on. @param couch  With the version that was read; kConflict if another one
  ///         is in force by now. Returns the new version.
  virtual void SignCouch(const Actor& actor, const CouchProfile& couch, Done done) = 0;
  /// The board as a PDF at true size (background). Nothing if the room's markers are too large for
  /// one; `why_not` then says so.
  [[nodiscard]] virtual std::optional<std::string> RoomBoardPdf(Message& why_not) = 0;
};

/// The rules of services.hpp hold.
class SensorProfileService {
 public:
  virtual ~SensorProfileService() = default;

  [[nodiscard]] virtual SensorProfiles GetSensorProfiles() = 0;  ///< (background)
  /// One version as written by `plumb calibrate`; nothing if there is none (background).
  [[nodiscard]] virtual std::optional<std::string> SensorProfileFile(int version) = 0;
  /// The unit starts again from its stated calibration.
  /// @param serial  Serial of the unit that the user has seen; kConflict if another one is
  ///         connected, and during a scan.
  virtual void ResetSensorProfile(const Actor& actor, const std::string& serial, Done done) = 0;
  [[nodiscard]] virtual SensorRepeats GetSensorRepeats() = 0;  ///< (background)
  /// Judges the unit by the newest sweeps without a patient; takes some seconds. kConflict where
  /// there are too few, for another unit, and during a scan.
  virtual void JudgeSensorRepeats(const Actor& actor, const std::string& serial, Done done) = 0;
  /// Restores an earlier version as the newest. kNotFound if it holds no profile.
  virtual void RollBackSensorProfile(const Actor& actor, const std::string& serial, int version,
                                     Done done) = 0;
};

}  // namespace plumb::web
