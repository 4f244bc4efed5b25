// SPDX-License-Identifier: Apache-2.0
// Three sweeps of a thing that did not move, as a step of the page: `plumb repeat` with the unit's
// own scans.
#pragma once

#include <string>
#include <vector>

#include "algo/comparison/comparison.hpp"
#include "daemon/sensor_profiles/profile_shelf.hpp"
#include "web/model/account.hpp"
#include "web/model/scan.hpp"
#include "web/model/sensor_profile.hpp"

namespace plumb {

/// @param scans  Newest first. Those count that belong to no patient, of this unit, of the last
///               hour and later than what was judged.
[[nodiscard]] SensorRepeats RepeatsOf(const std::string& serial, const std::vector<Scan>& scans,
                                      const ProfileShelf& shelf, WallClock::time_point now);

/// Compares the sweeps with each other, and keeps what that shows with the unit's profile. Takes
/// seconds.
/// @throws DataError where there are too few, or a scene cannot be read; IoError
void JudgeRepeatsOf(const SensorRepeats& repeats, const std::vector<Scan>& scans,
                    const CompareOptions& options, const Actor& actor, ProfileShelf& shelf,
                    WallClock::time_point now);

}  // namespace plumb
