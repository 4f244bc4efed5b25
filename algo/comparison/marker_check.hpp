// The daily check: do the markers lie as they lay when they were last accepted, and does the sensor
// still measure their true size?
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "algo/base/units.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// Limits of CheckMarkers(): starting values; a room may ask for less.
struct MarkerCheckLimits {
  double max_misfit_m = 3 * kMillimetre;  ///< RMS over corners after the rigid fit.
  double max_moved_m = 5 * kMillimetre;   ///< Of one marker's centre against all others.
  double max_side_share =
      0.03;  ///< A marker's side against its true length; where sides are measured at all.
  double max_scale_share = 0.005;  ///< Size of the whole marker map against the baseline's.
  double max_depth_share =
      0.03;             ///< Depth scale as the sweep's own calibration found it, against 1.
  int min_views = 3;    ///< Fewer: a marker counts as not seen.
  int min_markers = 3;  ///< Without a baseline.
};

/// One number of a check.
struct MarkerCheckItem {
  std::string name;    ///< markers_seen, misfit, moved, side, scale, depth_scale
  double value = 0.0;  ///< In `unit`; NaN: could not be computed.
  double limit = 0.0;  ///< `value` may reach it; markers_seen: must reach it.
  std::string unit;    ///< "", "mm" or "%"
  bool passed = false;
  std::string note;  ///< "marker 7", "missing: 3, 9"; may be empty.
};

enum class MarkerCheckStatus {
  kPassed,
  kFailed,
  kNoBaseline,  ///< Everything else passed, but there is nothing yet to compare with.
};
[[nodiscard]] const char* Name(MarkerCheckStatus status);  ///< "passed", "failed", "no_baseline"

struct MarkerCheck {
  MarkerCheckStatus status = MarkerCheckStatus::kFailed;
  std::vector<MarkerCheckItem> items;
  std::vector<std::string> reasons;  ///< Sentences: why it did not pass.
};

/// Markers that count as known, with what they were.
struct MarkerBaseline {
  MarkerMap markers;
  std::string dictionary;
  double marker_length_m = 0.0;
};
[[nodiscard]] MarkerBaseline BaselineOf(const Scene& scene, const MarkerCheckLimits& limits = {});

/// Compares the markers of a sweep with a baseline. A rigid motion of the whole (another reference
/// marker, another start) is no fault. Never throws for what a sweep holds; absence is a failed
/// item.
[[nodiscard]] MarkerCheck CheckMarkers(const Scene& scene,
                                       const std::optional<MarkerBaseline>& baseline,
                                       const MarkerCheckLimits& limits = {});

}  // namespace plumb
