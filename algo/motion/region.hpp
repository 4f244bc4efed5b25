// SPDX-License-Identifier: Apache-2.0
// Finds the body in a scene, and how much of the region of interest a scan measured.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "algo/base/pose.hpp"
#include "algo/motion/surface.hpp"
#include "algo/types/height_map.hpp"
#include "algo/types/point_cloud.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// The plane that carries the body: the floor around it or the top of the couch.
struct SupportPlane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< Unit length, pointing up.
  double offset_m = 0.0;
  [[nodiscard]] double Height(const Eigen::Vector3d& p) const { return normal.dot(p) - offset_m; }
};

/// A body on its support, in the frame of the surface in which it was found.
struct Body {
  enum Cell : std::uint8_t { kUnknown = 0, kMeasured = 1, kBody = 2 };
  std::optional<SupportPlane>
      support;  ///< Not set: no flat surface was found, and everything measured counts as body.
  double min_height_m = 0.0;
  double max_height_m = 0.0;
  GridShape grid;                   ///< Coarse grid in x and y of the frame.
  std::vector<std::uint8_t> cells;  ///< Cell values.
  std::vector<float> height_m;      ///< Height above the support; NaN where unknown.

  /// True if the point lies over the body's outline and within its height range.
  [[nodiscard]] bool Contains(const Eigen::Vector3d& p) const;
  [[nodiscard]] bool HighEnough(const Eigen::Vector3d& p) const;
};

/// Finds the large near-horizontal planes, takes the highest that carries nearly as much as any
/// other, and the largest connected part above it. The z axis of the frame points up to within 20
/// deg.
/// @param scene  The whole scene with a point spacing of about 1 cm.
[[nodiscard]] Body FindBody(const Surface& scene);

/// The largest connected part above a support that is known, as that of a planning CT.
[[nodiscard]] Body BodyOn(const SupportPlane& support, const PointCloud& scene_cloud);

/// Finds the body in a scene's full cloud with normals, as every comparison does.
[[nodiscard]] Body FindBody(const PointCloud& scene_cloud);

/// All points of a scene with their normals in the reference frame, from its cloud or, without a
/// cloud, from its height map.
[[nodiscard]] PointCloud SceneCloud(const Scene& scene, const Eigen::Affine3d& T_reference_scene);

/// Cells of the map in the region: they are valid, and either part of the body or inside the
/// polygon and above the support.
[[nodiscard]] std::vector<std::uint8_t> RegionMask(const HeightMap& map, const Body& body,
                                                   const std::vector<Eigen::Vector2d>& polygon_m);

/// The body of a scene's cloud. On a planning CT's, it lies on the couch if that is in the contour,
/// else on the support that the scene states.
[[nodiscard]] Body BodyOfScene(const Scene& scene, const PointCloud& scene_cloud);

/// The region mask of a reference scene's height map, as a comparison uses it. Empty without a
/// height map. Takes about 100 ms.
[[nodiscard]] std::vector<std::uint8_t> ReferenceRegion(
    const Scene& reference, const std::vector<Eigen::Vector2d>& polygon_m);

/// Mean of the region's surface points; nothing if the mask is empty.
[[nodiscard]] std::optional<Eigen::Vector3d> RegionCentroid(const HeightMap& map,
                                                            const std::vector<std::uint8_t>& mask);

/// The part of the region that the current scan measured, after correction for the motion.
struct RegionCoverage {
  double coverage = 0.0;  ///< Measured fraction of the region's valid reference cells, 0 to 1.
  double largest_hole_m =
      0.0;  ///< Diameter of the largest disc inside the region without current data.
  Eigen::Vector2d hole_centre_m = Eigen::Vector2d::Zero();  ///< In the reference frame.
};

/// Computes the measured fraction of the region and its largest hole. A cell is measured if the
/// current scan has data at the place to which the motion moved it.
/// @param current  The whole current scene in the reference frame, with a spacing of
///         `current_step_m`.
[[nodiscard]] RegionCoverage CoverageOf(const HeightMap& reference,
                                        const std::vector<std::uint8_t>& mask,
                                        const PointCloud& current, double current_step_m,
                                        const Pose& T_motion);

}  // namespace plumb
