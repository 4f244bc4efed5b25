// SPDX-License-Identifier: Apache-2.0
// Guidance during a sweep: how much was seen, and whether to go slower, closer or farther.
#pragma once

#include <cstdint>
#include <optional>
#include <unordered_set>

#include "algo/reconstruction/reconstructor.hpp"
#include "algo/types/frame.hpp"
#include "web/model/status.hpp"

namespace plumb {

/// Starting values; distances in metres, times in seconds by the frames' stamps.
struct GuidanceOptions {
  double max_speed_m_s = 0.7;   ///< Speed of the camera above which images blur and rows shear.
  double max_turn_rad_s = 1.4;  ///< Rotation rate of the camera.
  double min_distance_m = 0.5;  ///< Median depth.
  double max_distance_m = 1.3;
  double min_valid_depth =
      0.2;  ///< Fraction of pixels with depth; less means that the sensor is too close to measure.
  double lost_after_s = 0.3;  ///< Time without a pose.
  /// Time without a marker. Over a body there may be none for a moment; a sweep without markers
  /// cannot be compared.
  double no_markers_after_s = 4.0;
  double cell_m = 0.05;  ///< Cell of the coarse grid on which seen surface is counted.
  int pixel_step = 16;   ///< Pixels between points.
  double min_growth_m2 =
      0.03;  ///< Smaller areas are noise at the edges of what was seen before, not new coverage.
  double smoothing_s = 0.25;  ///< Time constant of the speed.
};

/// State of the sweep up to now.
struct SweepGuidance {
  SweepAdvice advice = SweepAdvice::kNone;
  double speed_m_s = 0.0;
  double turn_rad_s = 0.0;
  double median_depth_m = 0.0;
  double valid_depth = 0.0;
  /// All surface seen, including floor and markers; counted in coarse cells, so only for
  /// comparison.
  double area_m2 = 0.0;
  double elapsed_s = 0.0;  ///< Since the first frame.
  /// Time since new surface was last seen; 0 until there was some.
  double without_new_surface_s = 0.0;
};

/// Follows one sweep on the tracking thread; takes under a millisecond per frame. Not thread-safe.
class SweepGuide {
 public:
  explicit SweepGuide(const Intrinsics& intrinsics, const GuidanceOptions& options = {});

  /// @param report  Outcome of tracking the frame.
  const SweepGuidance& Add(const Frame& frame, const TrackingReport& report);

  [[nodiscard]] const SweepGuidance& guidance() const { return guidance_; }

 private:
  void UpdateSpeed(double time_s, const TrackingReport& report);
  void UpdateArea(const Frame& frame, const TrackingReport& report);
  [[nodiscard]] SweepAdvice Advice(double time_s) const;

  Intrinsics intrinsics_;
  GuidanceOptions options_;
  SweepGuidance guidance_;
  std::unordered_set<std::uint64_t> cells_;
  std::optional<double> first_s_, tracked_s_, marker_s_, grown_s_;
  Pose T_world_camera_ = Pose::Identity();
  double grown_area_m2_ = 0.0;
};

}  // namespace plumb
