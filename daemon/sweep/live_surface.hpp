// SPDX-License-Identifier: Apache-2.0
// The surface seen so far by a sweep, from above: it grows on the page during the sweep, together
// with the missing part of the region.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "algo/reconstruction/reconstructor.hpp"
#include "algo/types/frame.hpp"
#include "algo/types/height_map.hpp"

namespace plumb {

struct LiveSurfaceOptions {
  double half_width_m = 1.6;  ///< Of the square map around the reference marker.
  double cell_m = 0.02;
  /// Height above the marker's plane; points outside the limits belong to the room.
  double z_min_m = -0.3;
  double z_max_m = 0.8;
  /// Up to this distance points are dense enough that no cell is left out.
  double distance_m = 1.3;
  int min_points = 3;                 ///< Cells with fewer points are noise at an edge.
  std::size_t max_waiting = 300'000;  ///< Points kept until the reference marker has been seen.
};

/// Surfaces farther away are the room, measured with low accuracy.
inline constexpr double kFarthestSurface_m = 2.5;

/// Snapshot of a sweep, in the reference marker's frame.
struct LiveSurfaceView {
  HeightMap heights;  ///< NaN where nothing was seen.
  /// 1 for cells of the region that have not been seen yet; empty without a region.
  std::vector<std::uint8_t> missing;
  /// Fraction of the region that was seen; not set without a region.
  std::optional<double> coverage;
};

/// Follows one sweep on the tracking thread; takes well under a millisecond per frame. Not
/// thread-safe.
class LiveSurface {
 public:
  explicit LiveSurface(const Intrinsics& intrinsics, const LiveSurfaceOptions& options = {});

  /// @param report  Outcome of tracking the frame.
  void Add(const Frame& frame, const TrackingReport& report);
  /// Cells of `grid()` that have to be seen, one value per cell.
  void SetRegion(std::vector<std::uint8_t> region) { region_ = std::move(region); }
  [[nodiscard]] bool has_region() const { return !region_.empty(); }
  [[nodiscard]] const GridShape& grid() const { return grid_; }
  /// Null until the reference marker has been seen.
  [[nodiscard]] std::shared_ptr<const LiveSurfaceView> View() const;

 private:
  void Put(const Eigen::Vector3f& p_scene);

  Intrinsics intrinsics_;
  LiveSurfaceOptions options_;
  GridShape grid_;
  int pixel_step_;  ///< Pixels between points.
  std::vector<float> sum_m_;
  std::vector<std::uint32_t> count_;
  std::vector<std::uint8_t> region_;
  std::vector<Eigen::Vector3f> waiting_;  ///< In the tracker's world.
  bool is_placed_ = false;
};

/// The cells of `grid` that the region of interest covers, for LiveSurface::SetRegion().
/// @param polygon_m  Of the plan; with fewer than three corners the body found in the reference.
/// Empty if the reference shows no such region. Takes about 100 ms.
[[nodiscard]] std::vector<std::uint8_t> RegionToSee(const Scene& reference,
                                                    const std::vector<Eigen::Vector2d>& polygon_m,
                                                    const GridShape& grid);

}  // namespace plumb
