// The daily check as the store keeps it.
#pragma once

#include <optional>
#include <string>

#include "algo/comparison/marker_check.hpp"
#include "web/service/service_types.hpp"

namespace plumb {

/// A check with the markers that it saw: the next baseline may be made of them.
/// @param board             Those of the room's board, which are no markers of the room.
/// @param reference_marker  Whose frame it is all in; none: of no marker.
[[nodiscard]] std::string CheckJson(const MarkerCheck& check, const MarkerBaseline& seen,
                                    const MarkerMap& board = {},
                                    std::optional<int> reference_marker = {});

/// The markers in such a text; nothing if it is none.
[[nodiscard]] std::optional<MarkerBaseline> BaselineIn(const std::string& check_json);

/// What the page shows of it; id, time, user and sensor are left to the caller. One that cannot be
/// read is a failed check whose reason says so.
[[nodiscard]] web::CheckRecord CheckIn(const std::string& check_json);

}  // namespace plumb
