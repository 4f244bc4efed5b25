// SPDX-License-Identifier: Apache-2.0
// Breathing as one pattern of rise over a surface that otherwise lies still, learned from what a
// sensor at rest saw of some breaths.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

#include "algo/base/pose.hpp"
#include "algo/monitoring/block_image.hpp"
#include "algo/monitoring/view_model.hpp"

namespace plumb {

/// What was seen while the surface lay still: for each frame its time and, for each block, the
/// inverse depth (0: not measured).
struct BlockSeries {
  std::vector<double> time_s;
  std::vector<std::vector<float>> inverse_depth;
  [[nodiscard]] std::size_t size() const { return time_s.size(); }
};

/// Mean of each block over some frames of the series; 0 where less than half of them measured it.
/// @param frames  Begin and end.
[[nodiscard]] std::vector<float> MeanOf(const BlockSeries& series,
                                        std::pair<std::size_t, std::size_t> frames);

/// What a surface does while it breathes: one pattern, and a second one where parts of the body lag
/// behind others, as the chest behind the belly.
struct BreathingMode {
  /// Rise along the block's normal for each metre by which the belly's highest point rises; 0 where
  /// nothing is known.
  std::vector<float> rise;
  std::vector<float> lag;         ///< The second pattern, of the same size; empty without one.
  double lag_at_belly = 0.0;      ///< Rise of the belly's highest point for each metre of it.
  double lag_sigma_m = 0.0;       ///< Root mean square of the second pattern's size.
  double end_expiration_m = 0.0;  ///< Height of the belly then, about the mean of the series.
  double period_s = 0.0;
  double amplitude_m = 0.0;  ///< From end of expiration to end of inspiration.
  /// Shares of the first three components in all that moved, 0 to 1.
  std::array<double, 3> shares = {};
  std::pair<std::size_t, std::size_t> last_breath = {};  ///< Frames of it: begin, end.
  /// Longer breaths than the one found were possible, and fit less: it is no part of a longer one.
  bool is_whole = false;
  std::vector<Eigen::Vector2d> sizes_m = {};  ///< Of both patterns, by frame, about their means.

  /// Height of the belly's highest point above the end of expiration.
  [[nodiscard]] double Belly_m(const Eigen::Vector2d& size_m) const {
    return size_m[0] + lag_at_belly * size_m[1] - end_expiration_m;
  }
};

/// The first principal components of the rises along the normals. Nothing if the first does not
/// stand out (less than five times the third, twice the second), or if no whole breath can be found
/// in it: then there is no breathing to model.
/// @param model  Of the same blocks.
/// @param up     Away from the support, scene frame.
[[nodiscard]] std::optional<BreathingMode> LearnBreathing(const BlockSeries& series,
                                                          const ViewModel& model,
                                                          const BlockGrid& grid,
                                                          const Pose& T_scene_camera,
                                                          const Eigen::Vector3d& up);

}  // namespace plumb
