// Profiles of a sensor unit.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "web/model/wall_clock.hpp"

namespace plumb {

/// The profile of a sensor unit from then on.
struct SensorProfileVersion {
  int version = 0;
  WallClock::time_point made_at;
  std::string cause;  ///< "learned", "rolled_back", "reset" or "unreadable".
  /// Number of sweeps from which it was learned; 0: the stated calibration is used.
  int num_sweeps = 0;
  std::map<std::string, double> values;  ///< As scene.json names them.
};

/// Profiles of the connected sensor unit.
struct SensorProfiles {
  std::string serial;
  std::string why_none;                        ///< Why no profile is kept; empty if one is.
  std::vector<SensorProfileVersion> versions;  ///< Newest first; the first one is in use.
};

}  // namespace plumb
