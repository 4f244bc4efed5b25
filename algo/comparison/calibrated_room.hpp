// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "algo/base/message.hpp"
#include "algo/base/pose.hpp"
#include "algo/types/marker.hpp"

namespace plumb {

/// A room's calibration, as configured.
struct CalibratedRoom {
  std::optional<Pose> T_iec_reference;  ///< From the frame of the room's reference marker.
  /// Half-widths of its 95 % interval at the isocentre. Not set: exact, with a warning.
  std::optional<double> u95_m, u95_rad;
  /// What a signed calibration found of itself (RoomFit::U95_m()), in quadrature with the above.
  /// It does not see how well the lasers meet the isocentre, and so is no statement of that.
  double calibration_u95_m = 0.0, calibration_u95_rad = 0.0;
  /// The taught markers, in the frame that T_iec_reference maps from. Empty: that frame is found by
  /// a scan's reference marker alone.
  MarkerMap markers = {};
  /// Why there is no T_iec_reference, where that is known; empty: it was never calibrated.
  Message why_not = {};
};

}  // namespace plumb
