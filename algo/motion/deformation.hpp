// SPDX-License-Identifier: Apache-2.0
// Estimates how the shape of the body has changed between two scans, such as a moved arm.
#pragma once

#include <cstdint>
#include <optional>
#include <stop_token>
#include <vector>

#include <Eigen/Core>

#include "algo/base/pose.hpp"
#include "algo/motion/region.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb {

/// Both clouds in the reference frame (the current one after alignment); borrowed for the call.
struct DeformationInput {
  const PointCloud& reference_cloud;
  const Body& reference_body;
  const PointCloud& current_cloud;
  const Body& current_body;
  Pose T_motion = Pose::Identity();  ///< Rigid motion of the body: p_current = T_motion * p.
  std::stop_token stop = {};  ///< Polled in each iteration; a stop request throws Interrupted.
};

/// One displacement for each sample of the reference body's surface, about one per square
/// centimetre. It is what remains after the rigid correction: the sample's position in the current
/// scan, moved back by T_motion, minus its position in the reference scan. Reference frame, metres.
///
/// Only the component across the surface is measured. Along the surface the field is interpolated
/// smoothly, and samples without a correspondence follow the observed samples around them.
struct Deformation {
  std::vector<Eigen::Vector3f> points;
  std::vector<Eigen::Vector3f> shifts_m;
  std::vector<std::uint8_t> observed;  ///< 1 if the current scan shows this part of the surface.
  double residual_median_m = 0.0;      ///< Median of the observed samples, across the surface.
  double residual_p95_m = 0.0;
  double shift_median_m = 0.0;  ///< Median length of the observed samples' displacements.
  double shift_p95_m = 0.0;
};

/// Smooth non-rigid registration of the reference body to the current one.
///
/// An embedded deformation graph (Sumner, Schmid, Pauly: Embedded deformation for shape
/// manipulation, 2007): nodes every 6 cm on the surface, each with a rotation and a translation; a
/// sample follows its four nearest nodes. Gauss-Newton minimises point-to-plane distances with
/// Tukey weights and the disagreement of neighbouring nodes with Cauchy weights, so that an arm may
/// move independently of the trunk. Three stages with decreasing search radius and stiffness.
///
/// Returns nothing if either body has fewer than 50 samples. Deterministic and thread-safe.
[[nodiscard]] std::optional<Deformation> EstimateDeformation(const DeformationInput& input);

}  // namespace plumb
