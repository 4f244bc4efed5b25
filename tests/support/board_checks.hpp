// SPDX-License-Identifier: Apache-2.0
// Checks that saw the board of the room's calibration, as a scan would store them.
#pragma once

#include <optional>
#include <string>
#include <utility>

#include <Eigen/Geometry>

#include "algo/comparison/room_board.hpp"
#include "daemon/records/check_json.hpp"

namespace plumb::testing {

inline constexpr double kBoardMarker_m = 0.104;

inline SceneMarker MarkerAt(const Eigen::Vector3d& centre, const Pose& T_scene_room) {
  SceneMarker marker;
  marker.corners = CornersInMarkerFrame(kBoardMarker_m);
  for (Eigen::Vector3d& corner : marker.corners) corner = T_scene_room * (corner + centre);
  marker.num_views = 10;
  return marker;
}

// The reference marker lies turned and off the lasers.
inline Pose SceneFromRoom() {
  return Pose(Eigen::Translation3d(0.4, -0.9, 0.1) *
              Eigen::AngleAxisd(1.4, Eigen::Vector3d::UnitZ()));
}

inline MarkerMap MarkersOfRoom() {
  MarkerMap room;
  for (int id = 0; id < 6; ++id)
    room.emplace(id, MarkerAt({-0.6 + 0.6 * (id % 3), id < 3 ? -0.8 : 0.8, 0.1}, SceneFromRoom()));
  return room;
}

// A check scan over the board, whose cross lies `off_m` from the lasers.
inline TakenCheck CheckOver(double off_m = 0, int num_board_markers = 4,
                            MarkerMap room = MarkersOfRoom(),
                            std::optional<int> reference_marker = 0) {
  MarkerMap board;
  for (const auto& [id, centre] : MakeRoomBoard(250, kBoardMarker_m).centres_m) {
    if (board.size() < static_cast<std::size_t>(num_board_markers))
      board.emplace(id, MarkerAt({centre.x() + off_m, centre.y(), 0}, SceneFromRoom()));
  }
  return {.check = {.status = MarkerCheckStatus::kPassed, .items = {}, .reasons = {}},
          .seen = {std::move(room), "DICT_6X6_250", kBoardMarker_m},
          .board = std::move(board),
          .reference_marker = reference_marker};
}

}  // namespace plumb::testing
