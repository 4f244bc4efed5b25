// SPDX-License-Identifier: Apache-2.0
// Finds a body's breathing in the depth images of one sweep.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include <Eigen/Core>

#include "algo/surface/view_surface.hpp"
#include "algo/types/point_cloud.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// Distance of the surface that one view measured from the merged surface, over one patch.
struct PatchSample {
  std::uint32_t view = 0;
  float distance_m = 0.0F;  ///< Mean along the merged surface's normal.
  float weight = 0.0F;      ///< Relative, 1 at a depth of 1 m seen squarely.
};

/// A few centimetres of the merged surface, and how the views saw it.
struct SurfacePatch {
  Eigen::Vector3f centre_m = Eigen::Vector3f::Zero();
  Eigen::Vector3f normal = Eigen::Vector3f::UnitZ();  ///< Unit length.
  std::vector<PatchSample> samples;                   ///< By view, ascending.
  bool may_move = true;                               ///< False: cannot breathe.
};

/// Divides the merged surface into patches and measures each in every view that sees it. Runs in
/// parallel on TBB's threads; deterministic.
/// @throws Interrupted on a stop request.
[[nodiscard]] std::vector<SurfacePatch> MeasurePatches(std::span<const ViewSurface> views,
                                                       const PointCloud& cloud,
                                                       const std::stop_token& stop = {});

/// Finds the part of the surface that rises and falls together, with a period of 2 to 8 s, relative
/// to everything else that the same views show. Errors of the views' poses are estimated along with
/// it, because the registration mistakes part of the breathing for motion of the camera.
///
/// @param times_s  Of the views.
/// @return nothing with fewer than 8 views or less than 3 s; an amplitude of 0 if none was found.
[[nodiscard]] std::optional<Breathing> FindBreathing(std::span<const SurfacePatch> patches,
                                                     std::span<const double> times_s);

}  // namespace plumb
