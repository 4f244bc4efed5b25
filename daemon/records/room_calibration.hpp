// SPDX-License-Identifier: Apache-2.0
// Storage format of the room's calibration, which is made from check scans of the board.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "algo/comparison/marker_check.hpp"
#include "algo/comparison/room_board.hpp"
#include "web/model/wall_clock.hpp"

namespace plumb {

/// A check scan in which markers of the board were seen.
struct BoardScan {
  std::string check_id;
  WallClock::time_point time;
  std::string user;
  RoomMarkers room_markers = RoomMarkers::Unknown();
  std::optional<RoomScan> scan;  ///< Not set: `fault` states why.
  Message fault;
};

/// Reads a text of CheckJson() for a sweep over the board; nothing if no marker of the board was
/// seen.
[[nodiscard]] std::optional<BoardScan> BoardScanIn(const std::string& check_json);

/// The calibration that would be signed now.
struct RoomCandidate {
  std::vector<BoardScan> scans;  ///< Newest first; the newest usable ones count.
  std::optional<RoomFit> fit = {};
  Message why_not = {};     ///< Why it may not be signed; empty if it may.
  std::string json = {};    ///< Text to be stored; empty without a fit.
  std::string digest = {};  ///< SHA-256 of it in hexadecimal: the data that a person signs.
};
/// @param scans  Newest first.
[[nodiscard]] RoomCandidate RoomCandidateOf(std::vector<BoardScan> scans,
                                            const RoomCalibrationLimits& limits = {});

/// A signed calibration.
struct SignedRoom {
  int version = 0;
  WallClock::time_point signed_at;
  std::string signed_by;
  std::string digest;
  RoomFit fit;
  std::vector<std::string> check_ids;
  RoomMarkers room_markers = RoomMarkers::Unknown();  ///< All three are set.
};
/// Parses a candidate's text; the caller adds version and signature.
/// @throws DataError stating what is wrong with it.
[[nodiscard]] SignedRoom SignedRoomIn(const std::string& json);

/// Why the markers that a check saw show that the room has changed since it was calibrated, as one
/// sentence; empty if it has not. Nothing if it saw too little to decide: fewer of its markers than
/// place a scan.
[[nodiscard]] std::optional<Message> WhyRoomIsDue(const SignedRoom& room,
                                                  const MarkerBaseline& seen,
                                                  const MarkerCheckLimits& limits);

}  // namespace plumb
