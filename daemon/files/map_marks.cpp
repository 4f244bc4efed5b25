// SPDX-License-Identifier: Apache-2.0
#include "daemon/files/map_marks.hpp"

#include <string>

namespace plumb {

std::vector<MapMark> MapMarks(const std::optional<PatientAxes>& patient,
                              const std::optional<RoomWays>& room, const SideWords& words) {
  std::vector<MapMark> marks;
  const auto add = [&](std::string_view name, const Eigen::Vector2d& toward) {
    marks.push_back({std::string(name), toward.normalized()});
  };
  if (room) add(words.gantry, room->gantry);
  if (patient) {
    add(words.head, patient->head);
    add(words.feet, -patient->head);
    add(words.left, patient->left);
    add(words.right, -patient->left);
  } else if (room) {
    add("+X", room->right);
    add("\u2212X", -room->right);
  }
  return marks;
}

std::vector<MapMark> MapMarks(const Comparison& comparison) {
  if (!comparison.body_parts) return {};
  const BodyParts& body = *comparison.body_parts;
  const bool names_sides = body.by_posture && comparison.verdict != Verdict::kNoAnswer;
  return MapMarks(names_sides ? body.patient : std::nullopt, body.room);
}

}  // namespace plumb
