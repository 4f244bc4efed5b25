// SPDX-License-Identifier: Apache-2.0
// Storage formats of marker maps and of the daily check.
#pragma once

#include <optional>
#include <string>

#include <nlohmann/json.hpp>

#include "algo/comparison/marker_check.hpp"
#include "algo/types/marker.hpp"
#include "web/model/check.hpp"

namespace plumb {

[[nodiscard]] nlohmann::ordered_json MarkersJson(const MarkerMap& markers);
/// Nothing if it is not such a map, or one of its markers is invalid.
[[nodiscard]] std::optional<MarkerMap> MarkersIn(const nlohmann::ordered_json& json);

/// A check with the markers that it saw, from which the next baseline may be made.
struct TakenCheck {
  MarkerCheck check;
  MarkerBaseline seen = {};  ///< Markers of the room.
  MarkerMap board = {};      ///< Markers of the room's board, which do not belong to the room.
  std::optional<int> reference_marker =
      {};  ///< Marker whose frame is used; not set: another frame.
};

[[nodiscard]] std::string CheckJson(const TakenCheck& taken);

/// The markers in such a text; nothing if it is not one.
[[nodiscard]] std::optional<MarkerBaseline> BaselineIn(const std::string& check_json);

/// The page's record of it; the caller adds id, time, user and sensor. One that cannot be read is a
/// failed check whose reason says so.
[[nodiscard]] CheckRecord CheckIn(const std::string& check_json);

}  // namespace plumb
