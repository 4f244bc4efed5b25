// Storage format of marker maps.
#pragma once

#include <optional>

#include <nlohmann/json.hpp>

#include "algo/types/marker.hpp"

namespace plumb {

[[nodiscard]] nlohmann::ordered_json MarkersJson(const MarkerMap& markers);
/// Nothing if it is not such a map, or one of its markers is invalid.
[[nodiscard]] std::optional<MarkerMap> MarkersIn(const nlohmann::ordered_json& json);

}  // namespace plumb
