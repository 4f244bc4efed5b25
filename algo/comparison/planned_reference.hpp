// SPDX-License-Identifier: Apache-2.0
// What differs where the reference is a planning CT, or a scan of another room: calibrations of
// rooms join the two, and no shared marker does.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "algo/base/message.hpp"
#include "algo/base/pose.hpp"
#include "algo/comparison/calibrated_room.hpp"
#include "algo/comparison/motion_uncertainty.hpp"
#include "algo/comparison/scene_alignment.hpp"
#include "algo/types/point_cloud.hpp"
#include "algo/types/scene.hpp"
#include "algo/verdict/gates.hpp"

namespace plumb {

/// Where a scan lies in its room.
struct PlacedScan {
  std::optional<Alignment> alignment;  ///< T_reference_current maps to IEC axes.
  Message failure;                     ///< Why there is none.
  MarkerEvidence markers;
  PlaceUncertainty uncertainty;  ///< Its `origin_m` in IEC axes.
  std::vector<Message> warnings;
};

/// Places a scan in IEC axes by a room's calibration: by the taught markers where there are any,
/// otherwise by its reference marker alone. A marker is good if it was seen more than once (as far
/// as its scene states it), its sides are within 3 % of their length, and its corners are known to
/// 5 mm.
[[nodiscard]] PlacedScan PlaceInRoom(const Scene& scan, const CalibratedRoom& room, Preset preset,
                                     const MarkerConsensusOptions& options, int min_markers);

/// The alignment of two scans of different rooms to the frame of the reference scan.
/// @param reference, current  Both with an alignment.
[[nodiscard]] Alignment AlignAcrossRooms(const Alignment& reference, const Alignment& current);

/// What a surface that lies elsewhere than the skin of a planning CT would feign.
/// @param cloud  With normals, in IEC axes.
/// @param T_motion  p_current = T_motion * p_reference; `moved_m` is the moved centroid.
[[nodiscard]] FeignedMotions FeignedBy(const PointCloud& cloud,
                                       const std::function<bool(const Eigen::Vector3d&)>& in_region,
                                       const Pose& T_motion, const Eigen::Vector3d& moved_m);

}  // namespace plumb
