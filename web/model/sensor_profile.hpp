// SPDX-License-Identifier: Apache-2.0
// Profiles of a sensor unit.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "algo/base/names.hpp"
#include "web/model/wall_clock.hpp"

namespace plumb {

/// Why a version of a profile was made.
enum class ProfileCause : std::uint8_t { kLearned, kRolledBack, kReset, kUnreadable };
template <>
inline constexpr auto kNamesOf<ProfileCause> =
    NamesUpTo<ProfileCause::kUnreadable>({"learned", "rolled_back", "reset", "unreadable"});

/// The profile of a sensor unit from then on.
struct SensorProfileVersion {
  int version = 0;
  WallClock::time_point made_at;
  ProfileCause cause = ProfileCause::kLearned;
  /// Number of sweeps from which it was learned; 0: the stated calibration is used.
  int num_sweeps = 0;
  std::map<std::string, double> values;  ///< As scene.json names them.
};

/// Profiles of the connected sensor unit.
struct SensorProfiles {
  std::string serial;
  Message why_none;                            ///< Why no profile is kept; empty if one is.
  std::vector<SensorProfileVersion> versions;  ///< Newest first; the first one is in use.
};

/// Sweeps by which a unit is judged.
inline constexpr int kRepeatsWanted = 3;

/// What sweeps of a thing that did not move have shown about the connected unit.
struct SensorRepeats {
  struct Sweep {
    std::string scan_id;
    WallClock::time_point time;
  };
  std::string serial;
  Message why_none;                ///< Why the unit cannot be judged; empty if it can.
  std::vector<Sweep> sweeps = {};  ///< Made since, oldest first; the newest kRepeatsWanted at most.
  /// The newest judgement as `plumb repeat --json` writes it, with `user`, `made_s`,
  /// `profile_version` and `scans`; empty: none.
  std::string judged = {};
  bool is_due = true;  ///< There is none, or the profile was reset since.
};

}  // namespace plumb
