// SPDX-License-Identifier: Apache-2.0
// A moment as people read it.
#pragma once

#include <string>

#include "web/model/wall_clock.hpp"

namespace plumb::web {

/// Local time with its zone: "2026-03-09 14:05 CET".
[[nodiscard]] std::string LocalTimeText(WallClock::time_point time);

}  // namespace plumb::web
