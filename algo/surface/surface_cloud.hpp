// SPDX-License-Identifier: Apache-2.0
// Merges all views of a scene into one thin surface cloud.
#pragma once

#include <span>
#include <stop_token>

#include "algo/surface/view_surface.hpp"
#include "algo/types/keyframe.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb {

/// Parameters of MergeSurface(). Lengths in metres.
struct SurfaceCloudOptions {
  float voxel_size_m = 0.003F;  ///< One point per voxel; > 0.
  /// Number of views that must agree on a point (at most the number available).
  int min_views = 2;
  /// Views within this distance along the normal (or 4 sigma of the sensor) see the same surface.
  float band_m = 0.010F;
  bool with_colors = true;    ///< Add colours where the views have them.
  std::stop_token stop = {};  ///< Polled; see CheckStop().
};

/// The merged surface in the world frame, with normals and colours.
///
/// Each voxel that any view touches gives one seed (its best-weighted measurement). Seeds are not
/// averaged within their voxel, which would leave the surface as thick as the noise. Instead each
/// is projected into every view that sees it and moved along its normal to the robust,
/// noise-weighted mean of what they measured there. A seed is kept if at least `min_views` agree
/// and more views agree than see through it; the moved seeds are merged once more per voxel.
///
/// @param views  Corrected poses and depth; borrowed.
/// @return points ordered by voxel, the same for any number of threads. Empty if no view has a
///         usable pixel.
/// @throws std::invalid_argument if an option is out of range or a view's images do not fit its
///         intrinsics; Interrupted on a stop request.
[[nodiscard]] PointCloud MergeSurface(std::span<const ViewSurface> views,
                                      const SurfaceCloudOptions& options = {});

}  // namespace plumb
