// SPDX-License-Identifier: Apache-2.0
// The running scan, or the last one.
#pragma once

#include <algorithm>
#include <chrono>
#include <optional>
#include <string>

#include "daemon/scanning/scan_session.hpp"
#include "drivers/sensor.hpp"
#include "web/model/scan.hpp"

namespace plumb {

/// The running or last scan.
struct CurrentScan {
  std::string id;  ///< Empty until the store has assigned one.
  std::string patient_id;
  std::string session_id;
  std::string reference_id;
  ScanPurpose purpose = ScanPurpose::kFraction;
  double reference_area_m2 = 0.0;
  std::chrono::steady_clock::time_point started, ended;
  double first_frame_ms = 0.0;  ///< From the press to the first frame used.
  double cancel_ms = 0.0;       ///< From the cancellation to the end.
  std::chrono::steady_clock::time_point cancelled_at;
  SensorStatistics sensor_before;  ///< Counters of the sensor when the scan began.
  SensorStatistics images;         ///< Counters of the sensor for the sweep.
  ScanUpdate update;
  double dropped_fraction = 0.0;  ///< Fraction of images lost in the last two seconds, smoothed.
  EndedScan outcome;
  bool has_ended = false;

  /// Share of the reference that the sweep has seen; not set where that is not known.
  [[nodiscard]] std::optional<double> Coverage() const {
    // Area of the region itself once it is known: the part that the picture of the sweep shows as
    // missing.
    if (update.surface && update.surface->coverage) return update.surface->coverage;
    if (reference_area_m2 <= 0) return std::nullopt;
    return std::min(1.0, update.guidance.area_m2 / reference_area_m2);
  }
};

}  // namespace plumb
