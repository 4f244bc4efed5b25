// Preset `paper`: the method as published, stage by stage, after tracking.
//
// Paper symbol -> name here: P_i^j T_world_camera, C_i^j clouds_in_world, T_i^j T_refined_world,
// c^kl_i markers, FindTransform(L) ReferenceFrame(), h_i height_map. Departures from the print, all
// of them faults of the print: corners are moved by T_i^j P_i^j, not by T_i^j alone; compositions
// are rigid; the marker's z axis points out of the print.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <string_view>
#include <vector>

#include "algo/reconstruction/global_icp.hpp"
#include "algo/reconstruction/height_map_builder.hpp"
#include "algo/types/keyframe.hpp"
#include "algo/types/marker.hpp"

namespace plumb {

struct PaperOptions {
  GlobalIcpOptions icp;
  HeightMapOptions height_map;
  int depth_window_px = 11;             ///< s, at 640 columns.
  double marker_length_m = 0.104;       ///< l
  std::optional<int> reference_marker;  ///< Its id.
};

/// C_i^j: every valid depth pixel of every keyframe in the world frame, without colours. In
/// parallel. Keyframes without any depth are refused: leave them out.
/// @throws std::invalid_argument naming the keyframe whose images and intrinsics do not fit or that
/// has no depth.
[[nodiscard]] std::vector<PointCloud> KeyframeClouds(std::span<const Keyframe> keyframes);

/// Corner positions in the refined world: per corner the mean over the keyframes that hold it.
/// Markers with a corner that no keyframe places are left out. sigma_m is the corners' scatter over
/// the root of the views (1 cm for a single view).
/// @param T_refined_world  One a keyframe, from RefinePoses().
[[nodiscard]] MarkerMap AverageMarkers(std::span<const Keyframe> keyframes,
                                       std::span<const Pose> T_refined_world,
                                       int depth_window_px = 11);

/// T_marker_world of the given marker by the rigid fit of its four corners; nothing if the map
/// lacks it or it determines none.
[[nodiscard]] std::optional<Pose> ReferenceFrame(const MarkerMap& markers_in_world, int id,
                                                 double marker_length_m);

/// The per-keyframe height maps and their mean, clouds moved by T_marker_world * T_refined_world[j]
/// on the way.
[[nodiscard]] HeightMap HeightMapOfKeyframes(std::span<const PointCloud> clouds_in_world,
                                             std::span<const Pose> T_refined_world,
                                             const Pose& T_marker_world,
                                             const HeightMapOptions& options = {});

struct PaperReconstruction {
  std::vector<Pose> T_refined_world;    ///< One a keyframe; see RefinePoses().
  std::vector<double> icp_rms_m;        ///< Per iteration.
  MarkerMap markers_in_world;           ///< Refined world frame.
  std::optional<Pose> T_marker_world;   ///< Where the reference marker was given and seen.
  std::optional<HeightMap> height_map;  ///< Then, in the reference marker's frame.
};

/// All stages in order. `on_stage` (optional) is called on the calling thread when a stage begins:
/// "clouds", "global_registration", "markers", "height_map", and "" at the end, so that the caller
/// can time them; `progress` as for RefinePoses().
/// @throws std::invalid_argument as the stages; Interrupted on a stop request.
[[nodiscard]] PaperReconstruction ReconstructAsPublished(
    std::span<const Keyframe> keyframes, const PaperOptions& options,
    const std::stop_token& stop = {},
    const std::function<void(std::string_view stage)>& on_stage = {},
    const std::function<void(double fraction)>& progress = {});

}  // namespace plumb
