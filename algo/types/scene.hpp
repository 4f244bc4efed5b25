// SPDX-License-Identifier: Apache-2.0
// A reconstructed scene, which `plumb reconstruct` writes and `plumb compare` reads.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "algo/base/names.hpp"
#include "algo/base/pose.hpp"
#include "algo/sensor_model/depth_sensor.hpp"
#include "algo/sensor_model/sensor_sensitivity.hpp"
#include "algo/types/height_map.hpp"
#include "algo/types/marker.hpp"
#include "algo/types/planning_source.hpp"
#include "algo/types/point_cloud.hpp"

namespace plumb {

enum class Preset { kBest, kPaper };
template <>
inline constexpr auto kNamesOf<Preset> = NamesUpTo<Preset::kPaper>({"best", "paper"});

/// kIec: origin at the isocentre of a plan, axes of IEC 61217.
enum class SceneFrame { kReferenceMarker, kFirstKeyframe, kIec };
template <>
inline constexpr auto kNamesOf<SceneFrame> = NamesUpTo<SceneFrame::kIec>({"reference_marker",
                                                                          "first_keyframe", "iec"});

/// What a scene was made of.
enum class SceneSource { kSweep, kDicom };
template <>
inline constexpr auto kNamesOf<SceneSource> = NamesUpTo<SceneSource::kDicom>({"sweep", "dicom"});

/// A camera pose with its time (the depth image's stamp).
struct StampedPose {
  double time_s = 0.0;
  Pose T_world_camera = Pose::Identity();  ///< world = the scene's own frame
};

/// How far a part of the surface rose and fell during the sweep, as a chest does.
struct Breathing {
  double amplitude_m =
      0.0;                ///< From exhaled to inhaled, of the part that moved most; 0: none found.
  double sigma_m = 0.0;   ///< Standard deviation of the amplitude.
  double period_s = 0.0;  ///< 0: none found.
  double limit_m = 0.0;   ///< A smaller amplitude would not have been found in this sweep.
};

/// Content of one scan. Lengths in metres, everything in the scene's own frame.
struct Scene {
  Preset preset = Preset::kBest;
  SceneFrame frame = SceneFrame::kFirstKeyframe;
  std::optional<PlanningSource> planning;  ///< Of a scene that a planning CT gave; frame: kIec.
  RoomMarkers room_markers = RoomMarkers::Unknown();
  std::optional<DepthSensor> depth_sensor;  ///< Absent where no depth camera made the scene.
  MarkerMap markers;

  std::vector<StampedPose> keyframes;
  std::vector<StampedPose> trajectory;  ///< Every tracked frame.
  std::int64_t frames_total = 0;
  std::int64_t frames_tracked = 0;
  std::int64_t frames_dropped = 0;
  std::int64_t frames_fewer_keypoints = 0;  ///< Live, while the computer was too slow.
  double longest_lost_s = 0.0;  ///< Longest time without a pose between two tracked frames.

  std::optional<Breathing> breathing;  ///< Absent if the sweep does not allow an estimate.

  PointCloud cloud;  ///< Merged surface; always with normals, with colours unless disabled.
  std::optional<HeightMap> height_map;  ///< Only in the reference marker's frame.
  TriangleMesh mesh;                    ///< Mesh of the height map; may be empty.

  std::optional<SensorSensitivity> sensitivity;  ///< Absent where nothing was calibrated.
  std::optional<std::string> sensor_profile;     ///< Name of the sensor unit's profile.
  std::map<std::string, double> calibration;  ///< Estimated calibration; the keys state the units.
  /// Standard deviations of its terms after this sweep and before it. Terms that the sweep does not
  /// determine keep their prior one. Empty where nothing was calibrated.
  std::map<std::string, double> calibration_sigma, calibration_prior_sigma;
  /// Chi-square of the calibration against what was known before, for each of its terms; not set
  /// where nothing was calibrated.
  std::optional<double> calibration_chi2_per_term;
  std::map<std::string, double> timings_s;
  std::vector<Message> warnings;
  /// Why the scene must not be compared; empty if it may. Among the warnings, too.
  std::vector<Message> refusals;
  /// Fraction by which its lengths may be wrong beyond what every print may, because depth and the
  /// size of the markers disagree; 0 if they agree.
  double scale_doubt = 0.0;
};

}  // namespace plumb
