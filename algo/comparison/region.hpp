// Which part of a scene is the body, and how much of the region of interest a scan measured.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "algo/base/pose.hpp"
#include "algo/comparison/surface.hpp"
#include "algo/types/height_map.hpp"
#include "algo/types/point_cloud.hpp"
#include "algo/types/scene.hpp"

namespace plumb {

/// The plane that carries the body: the floor around it, or the top of the couch.
struct SupportPlane {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< Unit length, up.
  double offset_m = 0.0;
  [[nodiscard]] double Height(const Eigen::Vector3d& p) const { return normal.dot(p) - offset_m; }
};

struct BodyOptions {
  double min_height_m =
      0.025;  ///< Body is what rises more than this over the support: above noise, below a wrist.
  double max_height_m = 0.6;  ///< Higher: stands, hands, gantry.
  double cell_m = 0.015;      ///< Of the map of the body's outline.
  double max_tilt_rad =
      0.35;  ///< Of a support against the frame's z axis: a marker may lie on a wedge.
  double min_support_area_m2 = 0.08;  ///< No part of a body is as large and as flat.
};

/// A body on its support, in the frame of the surface it was found in.
struct Body {
  enum Cell : std::uint8_t { kUnknown = 0, kMeasured = 1, kBody = 2 };
  std::optional<SupportPlane>
      support;  ///< None: nothing flat was found, all that was measured counts as body.
  double min_height_m = 0.0;
  double max_height_m = 0.0;
  GridShape grid;                   ///< Coarse; x and y of the frame.
  std::vector<std::uint8_t> cells;  ///< Cell values.
  std::vector<float> height_m;      ///< Over the support, NaN where unknown.

  /// True if the point lies over the body's outline and within its heights.
  [[nodiscard]] bool Contains(const Eigen::Vector3d& p) const;
  [[nodiscard]] bool HighEnough(const Eigen::Vector3d& p) const;
};

/// Finds the large near-horizontal planes, takes the highest that carries (nearly) as much as any,
/// and the largest connected part over it. z of the frame points up to `options.max_tilt_rad`.
/// @param scene  The whole scene, about 1 cm spacing.
[[nodiscard]] Body FindBody(const Surface& scene, const BodyOptions& options = {});

/// The same of a whole scene's cloud with normals, as every comparison takes it.
[[nodiscard]] Body FindBody(const PointCloud& scene_cloud);

/// All points of a scene with their normals, in the reference's frame: its cloud, else one of its
/// height map.
[[nodiscard]] PointCloud SceneCloud(const Scene& scene, const Eigen::Affine3d& T_reference_scene);

/// Cells of the map that belong to the region: valid, and part of the body, or inside the polygon
/// and above the support.
[[nodiscard]] std::vector<std::uint8_t> RegionMask(const HeightMap& map, const Body& body,
                                                   const std::vector<Eigen::Vector2d>& polygon_m);

/// The same of a reference scene's height map, as a comparison with it takes them; empty without
/// one. Takes some 100 ms.
[[nodiscard]] std::vector<std::uint8_t> ReferenceRegion(
    const Scene& reference, const std::vector<Eigen::Vector2d>& polygon_m);

/// Mean of the region's surface points; nothing where the mask is empty.
[[nodiscard]] std::optional<Eigen::Vector3d> RegionCentroid(const HeightMap& map,
                                                            const std::vector<std::uint8_t>& mask);

/// What of the region the current scan measured, after the motion is taken into account.
struct RegionCoverage {
  double coverage = 0.0;  ///< Share 0..1 of the region's valid reference cells.
  double largest_hole_m =
      0.0;  ///< Diameter of the largest disc inside the region without current data.
  Eigen::Vector2d hole_centre_m = Eigen::Vector2d::Zero();  ///< Reference frame.
};

/// Share of the region that the current scan measured, and its largest hole. A cell is measured if
/// the current scan has data over the place where the motion took it.
/// @param current  All of the current scene, in the reference frame; `current_step_m` its spacing.
[[nodiscard]] RegionCoverage CoverageOf(const HeightMap& reference,
                                        const std::vector<std::uint8_t>& mask,
                                        const PointCloud& current, double current_step_m,
                                        const Pose& T_motion);

}  // namespace plumb
