// Maps of markers as the store's JSON.
#pragma once

#include <optional>

#include <nlohmann/json.hpp>

#include "algo/types/marker.hpp"

namespace plumb {

[[nodiscard]] nlohmann::ordered_json MarkersJson(const MarkerMap& markers);
/// Nothing where it is no such map, or one of its markers is none.
[[nodiscard]] std::optional<MarkerMap> MarkersIn(const nlohmann::ordered_json& json);

}  // namespace plumb
