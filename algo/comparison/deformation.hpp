// How the body has changed its shape between two scans: a moved arm, a filled belly.
#pragma once

#include <cstdint>
#include <optional>
#include <stop_token>
#include <vector>

#include <Eigen/Core>

#include "algo/base/pose.hpp"
#include "algo/comparison/region.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb {

/// Both clouds in the reference frame (the current one after alignment); borrowed for the call.
struct DeformationInput {
  const PointCloud& reference_cloud;
  const Body& reference_body;
  const PointCloud& current_cloud;
  const Body& current_body;
  Pose T_motion = Pose::Identity();  ///< Rigid motion of the body: p_current = T_motion * p.
  std::stop_token stop = {};         ///< Polled in each iteration; Interrupted follows.
};

/// A displacement for each sample of the reference body's surface, about one a square centimetre.
/// It is what the rigid correction leaves: where the sample lies in the current scan once that is
/// moved back by T_motion, minus where it lies in the reference scan. Reference frame, metres.
///
/// Only the part across the surface is measured; along the surface the field is as smooth as its
/// neighbourhood allows. Samples without a counterpart follow the observed ones around them.
struct Deformation {
  std::vector<Eigen::Vector3f> points;
  std::vector<Eigen::Vector3f> shifts_m;
  std::vector<std::uint8_t> observed;  ///< 1: the current scan shows this part of the surface.
  double residual_median_m = 0.0;      ///< Of the observed samples, across the surface.
  double residual_p95_m = 0.0;
  double shift_median_m = 0.0;  ///< Length of the observed samples' displacements.
  double shift_p95_m = 0.0;
};

/// Smooth non-rigid registration of the reference body to the current one.
///
/// An embedded deformation graph (Sumner, Schmid, Pauly: Embedded deformation for shape
/// manipulation, 2007): nodes every 6 cm on the surface, each with a rotation and a shift; a sample
/// follows its four nearest nodes. Gauss-Newton on point-to-plane distances with Tukey weights,
/// and on the nodes' disagreement about each other's place with Cauchy weights, so that an arm may
/// part from the trunk. Three stages with falling search radius and stiffness.
///
/// Nothing if either body has fewer than 50 samples. Deterministic, thread-safe.
[[nodiscard]] std::optional<Deformation> EstimateDeformation(const DeformationInput& input);

}  // namespace plumb
