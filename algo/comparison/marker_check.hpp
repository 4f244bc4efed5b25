// SPDX-License-Identifier: Apache-2.0
// The daily check: whether the markers are where they were when the baseline was accepted, and
// whether the sensor still measures their true size.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "algo/base/units.hpp"
#include "algo/types/scene.hpp"
#include "algo/verdict/verdict.hpp"

namespace plumb {

/// Limits of CheckMarkers(). These are starting values; a room may set tighter ones.
struct MarkerCheckLimits {
  double max_misfit_m = 3 * kMillimetre;  ///< RMS over the corners after the rigid fit.
  /// RMS distance of one marker's corners from where all others place them: it sees a marker that
  /// was turned in its place, too.
  double max_moved_m = 5 * kMillimetre;
  /// Measured side of a marker over its nominal length, minus 1; only where sides are measured.
  double max_side_error = 0.03;
  double max_scale_error = 0.005;  ///< Size of the marker map relative to the baseline's, minus 1.
  double max_depth_error = 0.03;   ///< Depth scale from the sweep's own calibration, minus 1.
  int min_views = 3;               ///< With fewer views a marker counts as not seen.
  int min_markers = 3;             ///< Fewest markers without a baseline.
  /// Of the baseline's markers. Each scan judges by itself which markers moved, so that those that
  /// were not seen need not have been checked, as long as most of them were.
  double min_seen_share = 0.8;
};

/// One quantity of a check.
struct MarkerCheckItem {
  std::string name;    ///< markers_seen, misfit, moved, side, scale or depth_scale.
  double value = 0.0;  ///< In `unit`; NaN if it could not be computed.
  double limit = 0.0;  ///< Largest allowed `value`; for markers_seen the smallest.
  std::string unit;    ///< "", "mm" or "%"
  bool passed = false;
  Message note;  ///< For example "marker 7" or "missing: 3, 9"; may be empty.
};

struct MarkerCheck {
  MarkerCheckStatus status = MarkerCheckStatus::kFailed;
  std::vector<MarkerCheckItem> items;
  std::vector<Message> reasons;  ///< Complete sentences that state why the check did not pass.
  /// Sentences about what was not checked without making it fail: markers that were not seen.
  std::vector<Message> cautions = {};
};

/// The markers that a check accepted, with their dictionary and length.
struct MarkerBaseline {
  MarkerMap markers;
  RoomMarkers room_markers = RoomMarkers::Unknown();
};
[[nodiscard]] MarkerBaseline BaselineOf(const Scene& scene, const MarkerCheckLimits& limits = {});

/// What would change if `wanted` takes the place of `baseline`, for people: markers that are
/// gone, new, moved by at least 1 mm after the rigid fit, or turned by 2 mm at the corners. Never
/// empty.
[[nodiscard]] std::vector<Message> ChangesOfBaseline(const MarkerBaseline& baseline,
                                                     const MarkerBaseline& wanted);

/// Compares the markers of a sweep with a baseline. A rigid motion of all markers together (another
/// reference marker or starting position) is not an error. Never throws because of what a sweep
/// contains; missing data is a failed item, and so is a missing reference marker. Other markers of
/// the baseline may be missing up to a share, with a caution that names them.
[[nodiscard]] MarkerCheck CheckMarkers(const Scene& scene,
                                       const std::optional<MarkerBaseline>& baseline,
                                       const MarkerCheckLimits& limits = {});

}  // namespace plumb
