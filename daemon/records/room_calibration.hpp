// The room's calibration as the store keeps it: made of check scans that saw the board.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "algo/comparison/marker_check.hpp"
#include "algo/comparison/room_board.hpp"
#include "web/service/service_types.hpp"

namespace plumb {

/// A check scan in which markers of the board were seen.
struct BoardScan {
  std::string check_id;
  web::WallClock::time_point time;
  std::string user;
  std::string dictionary;
  double marker_length_m = 0.0;
  std::optional<int> reference_marker;  ///< Whose frame it is all in.
  std::optional<RoomScan> scan;         ///< None: `fault` says why.
  std::string fault;
};

/// What CheckJson() wrote of a sweep over the board; nothing where no marker of it was seen.
[[nodiscard]] std::optional<BoardScan> BoardScanIn(const std::string& check_json);

/// What would be signed now.
struct RoomCandidate {
  std::vector<BoardScan> scans;  ///< Newest first; the newest usable ones count.
  std::optional<RoomFit> fit;
  std::string why_not;  ///< Why it may not be signed; empty: it may.
  std::string json;     ///< That is stored; empty without a fit.
  std::string digest;   ///< SHA-256 of it, in hexadecimal: what a person signs.
};
/// @param scans  Newest first.
[[nodiscard]] RoomCandidate RoomCandidateOf(std::vector<BoardScan> scans,
                                            const RoomCalibrationLimits& limits = {});

/// One that was signed.
struct SignedRoom {
  int version = 0;
  web::WallClock::time_point signed_at;
  std::string signed_by;
  std::string digest;
  RoomFit fit;
  std::vector<std::string> check_ids;
  std::string dictionary;
  double marker_length_m = 0.0;
  int reference_marker = 0;  ///< Id.
};
/// Of a candidate's text; version and signature are left to the caller.
/// @throws DataError saying what is wrong with it.
[[nodiscard]] SignedRoom SignedRoomIn(const std::string& json);

/// Why this check shows that the room is no longer as it was calibrated: one sentence; empty: it
/// is. Nothing where the check saw too little to say.
[[nodiscard]] std::optional<std::string> WhyRoomIsDue(const SignedRoom& room,
                                                      const std::string& check_json,
                                                      const MarkerCheckLimits& limits);

}  // namespace plumb
