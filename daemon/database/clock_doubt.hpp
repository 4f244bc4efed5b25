// SPDX-License-Identifier: Apache-2.0
// A clock that is far ahead of everything that is stored: the unit was off for a long time, or the
// clock is wrong, for example because its battery is empty. Nothing is removed for its age until a
// time server has set the clock, or a person has confirmed the date by saving the settings.
#pragma once

#include <chrono>

#include "daemon/database/database.hpp"
#include "web/model/wall_clock.hpp"

namespace plumb {

inline constexpr std::chrono::hours kLeap{24 * 14};

/// Doubts the clock if it is more than kLeap ahead of the newest entry of the log. To be called
/// before anything is written with the clock's time. @throws IoError and its kinds
void DoubtAfterLeap(Database& database, WallClock::time_point now);
void DoubtClock(Database& database);
[[nodiscard]] bool IsClockDoubted(Database& database);
/// To be called within a change.
void TrustClock(Database& database);

}  // namespace plumb
