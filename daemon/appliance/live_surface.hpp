// The surface that a sweep has seen so far, from above: it grows on the page while somebody sweeps,
// beside what of the region is still missing.
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
  double z_min_m = -0.3;  ///< Over the marker's plane; what lies outside is the room.
  double z_max_m = 0.8;
  double distance_m = 1.3;  ///< Up to here points are taken so densely that no cell is left out.
  int min_points = 3;       ///< Fewer in a cell are noise at an edge.
  std::size_t max_waiting = 300'000;  ///< Points kept until the reference marker has been seen.
};

/// What there is to see at one moment of a sweep. Reference marker's frame.
struct LiveSurfaceView {
  HeightMap heights;                  ///< NaN where nothing was seen.
  std::vector<std::uint8_t> missing;  ///< 1: a cell of the region that was not seen yet; empty:
                                      ///< there is no region.
  std::optional<double> coverage;     ///< Share of the region that was seen; nothing: no region.
};

/// Follows one sweep on the tracking thread; well under a millisecond a frame. Not thread-safe.
class LiveSurface {
 public:
  explicit LiveSurface(const Intrinsics& intrinsics, const LiveSurfaceOptions& options = {});

  /// @param report  What tracking made of the frame.
  void Add(const Frame& frame, const TrackingReport& report);
  /// Cells of `grid()` that have to be seen; as many as it has.
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
  int pixel_step_;  ///< Every so many pixels a point is taken.
  std::vector<float> sum_m_;
  std::vector<std::uint32_t> count_;
  std::vector<std::uint8_t> region_;
  std::vector<Eigen::Vector3f> waiting_;  ///< In the tracker's world.
  bool is_placed_ = false;
};

/// The cells of `grid` that the region of interest covers, for LiveSurface::SetRegion().
/// @param polygon_m  Of the plan; fewer than three corners: the body found in the reference.
/// Empty where the reference shows no such region. Takes some 100 ms.
[[nodiscard]] std::vector<std::uint8_t> RegionToSee(const Scene& reference,
                                                    const std::vector<Eigen::Vector2d>& polygon_m,
                                                    const GridShape& grid);

}  // namespace plumb
