// SPDX-License-Identifier: Apache-2.0
#include "daemon/sweep/sweep_guidance.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "daemon/sweep/live_surface.hpp"

namespace plumb {

namespace {

/// Key of a cell of the coarse grid; unique within 50 km of the first camera.
std::uint64_t CellKey(const Eigen::Vector3d& p_world, double cell_m) {
  const auto part = [&](double v) {
    return static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(v / cell_m)) +
                                      (1 << 20)) &
           0x1FFFFF;
  };
  return part(p_world.x()) << 42 | part(p_world.y()) << 21 | part(p_world.z());
}

}  // namespace

SweepGuide::SweepGuide(const Intrinsics& intrinsics, const GuidanceOptions& options)
    : intrinsics_(intrinsics), options_(options) {
  if (!(options.cell_m > 0) || options.pixel_step < 1)
    throw std::invalid_argument("guidance needs cells and a pixel step above 0");
}

const SweepGuidance& SweepGuide::Add(const Frame& frame, const TrackingReport& report) {
  const double time_s = frame.depth_time_s;
  if (!first_s_) first_s_ = time_s;
  guidance_.elapsed_s = time_s - *first_s_;
  guidance_.median_depth_m = report.median_depth_m;
  guidance_.valid_depth = report.valid_depth;
  if (report.tracked) {
    UpdateSpeed(time_s, report);
    UpdateArea(frame, report);
    if (report.num_markers > 0) marker_s_ = time_s;
  }
  guidance_.without_new_surface_s = std::max(0.0, time_s - grown_s_.value_or(*first_s_));
  guidance_.advice = Advice(time_s);
  return guidance_;
}

void SweepGuide::UpdateSpeed(double time_s, const TrackingReport& report) {
  if (tracked_s_ && time_s > *tracked_s_) {
    const double elapsed_s = time_s - *tracked_s_;
    const Pose T_before_now = T_world_camera_.inverse() * report.T_world_camera;
    const double weight = 1.0 - std::exp(-elapsed_s / options_.smoothing_s);
    guidance_.speed_m_s +=
        weight * (T_before_now.translation().norm() / elapsed_s - guidance_.speed_m_s);
    guidance_.turn_rad_s +=
        weight * (RotationAngle(T_before_now) / elapsed_s - guidance_.turn_rad_s);
  }
  tracked_s_ = time_s;
  T_world_camera_ = report.T_world_camera;
}

void SweepGuide::UpdateArea(const Frame& frame, const TrackingReport& report) {
  for (int v = options_.pixel_step / 2; v < frame.depth_m.rows; v += options_.pixel_step) {
    const float* row = frame.depth_m.ptr<float>(v);
    for (int u = options_.pixel_step / 2; u < frame.depth_m.cols; u += options_.pixel_step) {
      const double z = row[u];
      if (!(z > 0) || z > kFarthestSurface_m) continue;
      const Eigen::Vector3d p_camera((u - intrinsics_.cx) / intrinsics_.fx * z,
                                     (v - intrinsics_.cy) / intrinsics_.fy * z, z);
      cells_.insert(CellKey(report.T_world_camera * p_camera, options_.cell_m));
    }
  }
  guidance_.area_m2 = static_cast<double>(cells_.size()) * options_.cell_m * options_.cell_m;
  if (guidance_.area_m2 < grown_area_m2_ + options_.min_growth_m2) return;
  grown_area_m2_ = guidance_.area_m2;
  grown_s_ = frame.depth_time_s;
}

SweepAdvice SweepGuide::Advice(double time_s) const {
  if (time_s - tracked_s_.value_or(*first_s_) > options_.lost_after_s)
    return SweepAdvice::kTrackingLost;
  if (time_s - marker_s_.value_or(*first_s_) > options_.no_markers_after_s)
    return SweepAdvice::kNoMarkers;
  if (guidance_.valid_depth < options_.min_valid_depth) return SweepAdvice::kFarther;
  if (guidance_.median_depth_m > 0 && guidance_.median_depth_m < options_.min_distance_m)
    return SweepAdvice::kFarther;
  if (guidance_.median_depth_m > options_.max_distance_m) return SweepAdvice::kCloser;
  if (guidance_.speed_m_s > options_.max_speed_m_s ||
      guidance_.turn_rad_s > options_.max_turn_rad_s)
    return SweepAdvice::kSlower;
  return SweepAdvice::kNone;
}

}  // namespace plumb
