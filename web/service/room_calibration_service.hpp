// What the page asks of the room's calibration: where the room's axes lie.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "web/service/change.hpp"
#include "web/service/service_types.hpp"

namespace plumb::web {

/// One check scan that saw the board.
struct RoomBoardScan {
  std::string check_id;
  WallClock::time_point time;
  std::string user;
  std::string fault;  ///< Why it cannot be used; empty: the numbers are known.
  std::size_t num_markers = 0;
  double rms_mm = 0.0;
  double scale_percent = 100.0;
  /// 95 % half-widths, of this scan alone.
  double shift_uncertainty_mm = 0.0;
  double turn_uncertainty_deg = 0.0;
};

/// One that was signed.
struct RoomCalibrationVersion {
  int version = 0;
  WallClock::time_point signed_at;
  std::string signed_by;
  std::string digest;     ///< SHA-256, hexadecimal.
  double shift_mm = 0.0;  ///< By how much its scans differ.
  double turn_deg = 0.0;
  std::vector<std::string> check_ids;
};

struct RoomCalibrationStatus {
  std::vector<RoomCalibrationVersion> versions;  ///< Newest first; the first one holds.
  /// Why comparisons do not use the one that holds: a marker moved since, or it cannot be read.
  std::string due;
  bool is_configured = false;  ///< [iec] T_iec_reference is set; it counts only without a version.
  std::vector<RoomBoardScan> scans;  ///< Since then, of today and this sensor; newest first.
  std::size_t num_wanted = 3;        ///< Scans.
  std::optional<double> shift_mm;    ///< By how much the scans differ so far.
  std::optional<double> turn_deg;
  double max_shift_mm = 0.0;
  double max_turn_deg = 0.0;
  std::string why_not_sign;  ///< Empty: it may be signed.
  std::string digest;        ///< Of what would be signed.
};

/// The rules of services.hpp hold.
class RoomCalibrationService {
 public:
  virtual ~RoomCalibrationService() = default;

  [[nodiscard]] virtual RoomCalibrationStatus GetRoomCalibration() = 0;  ///< Aside.
  /// @param digest  Of what was read and is signed; kConflict where it is not what would be stored,
  ///                or where it may not be signed. Gives the version.
  virtual void SignRoomCalibration(const Actor& actor, const std::string& digest, Done done) = 0;
  /// The board as a PDF at true size (aside). Nothing: the room's markers are too large for one,
  /// and the sentence says so.
  [[nodiscard]] virtual std::optional<std::string> RoomBoardPdf(std::string& why_not) = 0;
};

}  // namespace plumb::web
