// SPDX-License-Identifier: Apache-2.0
#include "daemon/records/room_calibration.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/types/marker_dictionary.hpp"
#include "daemon/records/check_json.hpp"
#include "daemon/scan_files/scan_files.hpp"
#include "words/check.hpp"
#include "words/store.hpp"

namespace plumb {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kCalibrationFormat = 1;

Json PoseJson(const Pose& T) {
  Json rows = Json::array();
  for (int row = 0; row < 4; ++row) {
    const Eigen::RowVector4d line = T.matrix().row(row);
    rows.push_back({line(0), line(1), line(2), line(3)});
  }
  return rows;
}

Pose PoseIn(const Json& rows) {
  Pose T = Pose::Identity();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column)
      T.matrix()(row, column) =
          rows.at(static_cast<std::size_t>(row)).at(static_cast<std::size_t>(column)).get<double>();
  }
  const Eigen::Matrix3d R = T.linear();
  if (!(R.transpose() * R).isApprox(Eigen::Matrix3d::Identity(), 1e-6) || R.determinant() < 0 ||
      !T.translation().allFinite())
    throw DataError(say::store::RoomNotRigid());
  return T;
}

std::string JsonOf(const RoomFit& fit, std::span<const BoardScan> scans) {
  Json json = {{"format", kCalibrationFormat},
               {"dictionary", scans[0].room_markers.dictionary},
               {"marker_length_m", scans[0].room_markers.length_m},
               {"reference_marker", scans[0].room_markers.reference.value()},
               {"T_iec_reference", PoseJson(fit.T_iec_reference)},
               {"shift_m", fit.shift_m},
               {"turn_rad", fit.turn_rad},
               {"scans", Json::array()}};
  for (const BoardScan& scan : scans) {
    const BoardFit& board = scan.scan->board;
    json["scans"].push_back({{"check", scan.check_id},
                             {"rms_m", board.rms_m},
                             {"scale", board.scale},
                             {"markers", board.num_markers},
                             {"shift_uncertainty_m", board.shift_uncertainty_m},
                             {"turn_uncertainty_rad", board.turn_uncertainty_rad}});
  }
  json["markers_iec"] = MarkersJson(fit.markers_iec);
  return json.dump();
}

}  // namespace

std::optional<BoardScan> BoardScanIn(const std::string& check_json) {
  const Json json = ParseBoundedJsonOrNothing<Json>(check_json);
  if (!json.is_object() || !json.contains("board")) return std::nullopt;
  const auto board = MarkersIn(json["board"]);
  if (!board || board->empty()) return std::nullopt;
  BoardScan seen;
  const auto room = BaselineIn(check_json);
  if (!room) {
    seen.fault = say::store::BoardWithoutRoom();
    return seen;
  }
  seen.room_markers = room->room_markers;
  const Json reference = json.value("reference_marker", Json());
  if (!reference.is_number_integer()) {
    seen.fault = say::store::BoardWithoutReference();
    return seen;
  }
  seen.room_markers.reference = reference.get<int>();
  try {
    const int size = MarkerDictionary::ByName(seen.room_markers.dictionary).size();
    auto fit = FitRoomBoard(MakeRoomBoard(size, seen.room_markers.length_m), *board);
    if (auto* why = std::get_if<1>(&fit))
      seen.fault = *why;
    else
      seen.scan = RoomScan{room->markers, std::get<BoardFit>(fit)};
  } catch (const std::exception& error) {  // unknown dictionary, or no board of such markers
    seen.fault = MessageOf(error);
  }
  return seen;
}

RoomCandidate RoomCandidateOf(std::vector<BoardScan> scans, const RoomCalibrationLimits& limits) {
  RoomCandidate candidate{.scans = std::move(scans)};
  std::vector<BoardScan> used;
  std::vector<RoomScan> seen;
  for (const BoardScan& scan : candidate.scans) {
    if (!scan.scan || used.size() == limits.num_scans) continue;
    if (!used.empty() && scan.room_markers != used[0].room_markers)
      break;  // the markers were configured differently then
    used.push_back(scan);
    seen.push_back(*scan.scan);
  }
  if (used.empty()) {
    candidate.why_not = candidate.scans.empty()
                            ? say::store::BoardNotScanned()
                            : say::store::BoardUnusable(candidate.scans[0].fault);
    return candidate;
  }
  auto fit = FitRoom(seen);
  if (auto* why = std::get_if<1>(&fit)) {
    candidate.why_not = *why;
    return candidate;
  }
  candidate.fit = std::get<RoomFit>(std::move(fit));
  candidate.why_not = WhyNotSign(*candidate.fit, used.size(), limits);
  candidate.json = JsonOf(*candidate.fit, used);
  candidate.digest = Sha256Of(candidate.json);
  return candidate;
}

SignedRoom SignedRoomIn(const std::string& text) {
  try {
    const Json json = ParseBoundedJson<Json>(text);
    if (json.at("format").get<int>() != kCalibrationFormat)
      throw DataError(say::store::RoomFormat(kCalibrationFormat, json["format"].dump()));
    SignedRoom room;
    room.digest = Sha256Of(text);
    room.room_markers = {.dictionary = json.at("dictionary").get<std::string>(),
                         .length_m = json.at("marker_length_m").get<double>(),
                         .reference = json.at("reference_marker").get<int>()};
    room.fit.T_iec_reference = PoseIn(json.at("T_iec_reference"));
    room.fit.shift_m = json.at("shift_m").get<double>();
    room.fit.turn_rad = json.at("turn_rad").get<double>();
    for (const Json& scan : json.at("scans")) {
      room.check_ids.push_back(scan.at("check").get<std::string>());
      room.fit.board_shift_m =
          std::max(room.fit.board_shift_m, scan.at("shift_uncertainty_m").get<double>());
      room.fit.board_turn_rad =
          std::max(room.fit.board_turn_rad, scan.at("turn_uncertainty_rad").get<double>());
    }
    auto markers = MarkersIn(json.at("markers_iec"));
    if (!markers || markers->empty()) throw DataError(say::store::RoomMarkersUnreadable());
    room.fit.markers_iec = std::move(*markers);
    return room;
  } catch (const std::exception& error) {
    throw DataError(say::store::RoomUnusable(MessageOf(error)));
  }
}

std::optional<Message> WhyRoomIsDue(const SignedRoom& room, const MarkerBaseline& seen,
                                    const MarkerCheckLimits& limits) {
  if (seen.room_markers.dictionary != room.room_markers.dictionary ||
      std::abs(seen.room_markers.length_m - room.room_markers.length_m) > 1e-6)
    return say::store::RoomOtherMarkers();
  Scene scene;
  scene.markers = seen.markers;
  scene.room_markers = seen.room_markers;
  const MarkerCheck check =
      CheckMarkers(scene, MarkerBaseline{room.fit.markers_iec, room.room_markers}, limits);
  std::optional<Message> answer;
  for (const MarkerCheckItem& item : check.items) {
    if (item.name != "misfit" && item.name != "moved") continue;
    if (!answer) answer.emplace();
    if (item.passed || !answer->empty()) continue;
    *answer = item.name == "misfit" ? say::store::RoomMisfit(item.value)
              : item.note.Is(say::check::kTurned)
                  ? say::store::RoomMarkerTurned(item.note)
                  : say::store::RoomMarkerMoved(item.note, item.value);
  }
  // Enough was seen, and it does not fit: all were moved, or two groups of them.
  const auto shared = std::count_if(seen.markers.begin(), seen.markers.end(), [&](const auto& one) {
    return room.fit.markers_iec.contains(one.first);
  });
  if (!answer && shared >= limits.min_markers) return say::store::RoomMarkersMoved(shared);
  return answer;
}

}  // namespace plumb
