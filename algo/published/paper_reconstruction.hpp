// SPDX-License-Identifier: Apache-2.0
// Preset `paper`: the method as published, stage by stage, after tracking.
//
// Paper symbol -> name here: P_i^j T_world_camera, C_i^j clouds_in_world, T_i^j T_refined_world,
// c^kl_i markers, FindTransform(L) ReferenceFrame(), h_i height_map. Departures from the text, all
// of which correct errors in the text: corners are moved by T_i^j P_i^j, not by T_i^j alone;
// compositions are rigid; the marker's z axis points out of the print.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <string_view>
#include <vector>

#include "algo/published/global_icp.hpp"
#include "algo/surface/height_maps.hpp"
#include "algo/types/keyframe.hpp"
#include "algo/types/marker.hpp"

namespace plumb {

struct PaperOptions {
  GlobalIcpOptions icp;
  HeightMapOptions height_map;
  RoomMarkers room_markers = RoomMarkers::Unknown();  ///< l is their length: required.
};

/// C_i^j: every valid depth pixel of every keyframe in the world frame, without colours. Runs in
/// parallel. Keyframes without depth are rejected; leave them out.
/// @throws std::invalid_argument naming the keyframe whose images do not fit its intrinsics or that
///         has no depth.
[[nodiscard]] std::vector<PointCloud> KeyframeClouds(std::span<const Keyframe> keyframes);

/// Corner positions in the refined world: for each corner the mean over the keyframes that measured
/// it. Markers with an unmeasured corner are left out. sigma_m is the scatter of the corners over
/// the square root of the number of views (1 cm for a single view).
/// @param T_refined_world  One per keyframe, from RefinePoses().
[[nodiscard]] MarkerMap AverageMarkers(std::span<const Keyframe> keyframes,
                                       std::span<const Pose> T_refined_world);

/// T_marker_world of the given marker by the rigid fit of its four corners; nothing if the map does
/// not contain it or its corners determine no pose.
[[nodiscard]] std::optional<Pose> ReferenceFrame(const MarkerMap& markers_in_world, int id,
                                                 double marker_length_m);

/// The height maps of the keyframes and their mean, with the clouds transformed by T_marker_world *
/// T_refined_world[j].
[[nodiscard]] HeightMap HeightMapOfKeyframes(std::span<const PointCloud> clouds_in_world,
                                             std::span<const Pose> T_refined_world,
                                             const Pose& T_marker_world,
                                             const HeightMapOptions& options = {});

struct PaperReconstruction {
  std::vector<Pose> T_refined_world;   ///< One per keyframe; see RefinePoses().
  std::vector<double> icp_rms_m;       ///< One per iteration.
  MarkerMap markers_in_world;          ///< In the refined world frame.
  std::optional<Pose> T_marker_world;  ///< Set if the reference marker was given and seen.
  /// Set under the same condition; in the reference marker's frame.
  std::optional<HeightMap> height_map;
};

/// All stages in order. `on_stage` (optional) is called on the calling thread when a stage begins:
/// "clouds", "global_registration", "markers", "height_map", and "" at the end, so that the caller
/// can time them; `progress` as in RefinePoses().
/// @throws std::invalid_argument as the stages do; Interrupted on a stop request.
[[nodiscard]] PaperReconstruction ReconstructAsPublished(
    std::span<const Keyframe> keyframes, const PaperOptions& options,
    const std::stop_token& stop = {},
    const std::function<void(std::string_view stage)>& on_stage = {},
    const std::function<void(double fraction)>& progress = {});

}  // namespace plumb
