// SPDX-License-Identifier: Apache-2.0
// A scene and a comparison of few points, with everything that can be written of them.
#pragma once

#include <cstddef>
#include <limits>

#include "algo/base/pose.hpp"
#include "algo/comparison/comparison.hpp"
#include "algo/types/height_map.hpp"
#include "algo/types/marker.hpp"
#include "algo/types/scene.hpp"

namespace plumb::testing {

inline StampedPose PoseAt(double time_s) {
  StampedPose pose{time_s, Pose::Identity()};
  pose.T_world_camera.linear() = RotationFromVector(Eigen::Vector3d(2.9, 0.3 * time_s, -0.7));
  pose.T_world_camera.translation() = Eigen::Vector3d(0.1 * time_s, -1.23456789, 0.777);
  return pose;
}

/// A sensitivity of three terms, with one patch and one marker.
inline SensorSensitivity SmallSensitivity() {
  SensorSensitivity s;
  s.stated = {640, 480, 525.5, 524.25, 319.5, 239.5, {0.1, -0.2, 0.001, 0.002, 0.05}};
  s.stated_for_this_unit = true;
  s.serial = "1804060024";
  s.estimate = Eigen::Vector3d(0.001, -1.25, 3.0 / 7.0);
  s.covariance = Eigen::Matrix3d::Zero();
  s.covariance << 4, 1, 0.5, 1, 9, 0.25, 0.5, 0.25, 1.0 / 3.0;
  SensorSensitivity::Derivative d(3, 3);
  d << 1, 2, 3, 4, 5, 6, 7, 8, 9;
  s.surface.push_back({Eigen::Vector3f(0.25F, 0.5F, -0.125F), 75.0F, d});
  s.markers[7] = 0.5F * d;
  return s;
}

inline Scene SmallScene() {
  Scene scene;
  scene.preset = Preset::kPaper;
  scene.frame = SceneFrame::kReferenceMarker;
  scene.room_markers.dictionary = "DICT_ARUCO_MIP_36h12";
  scene.room_markers.length_m = 0.104;
  scene.room_markers.reference = 11;
  scene.markers[11] = {CornersInMarkerFrame(0.104), 9, 0.0004};
  scene.markers[100] = {CornersInMarkerFrame(0.104), 2, 0.002};
  scene.markers[100].corners[2] = Eigen::Vector3d(1.0 / 3.0, -0.1, 1e-9);
  scene.keyframes = {PoseAt(1), PoseAt(3)};
  scene.trajectory = {PoseAt(1), PoseAt(2), PoseAt(3)};
  scene.frames_total = 5;
  scene.frames_tracked = 3;
  scene.frames_dropped = 1;
  scene.frames_fewer_keypoints = 2;
  scene.longest_lost_s = 0.25;
  scene.breathing = Breathing{0.004, 0.0005, 3.5, 0.0015};
  scene.cloud.points = {{0, 0, 0.1F}, {0.5F, 0.25F, 0.125F}};
  scene.cloud.normals = {{0, 0, 1}, {0, 1, 0}};
  scene.cloud.colors = {Color{1, 2, 3}, Color{4, 5, 6}};
  scene.height_map.emplace(GridShape{-0.1, -0.2, 0.0015, 7, 3});
  scene.height_map->z[0] = 0.01F;
  scene.height_map->z[9] = -0.02F;
  scene.mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  scene.mesh.triangles = {{0, 1, 2}};
  scene.calibration["depth_scale"] = 1.00123;
  scene.calibration_sigma["depth_scale"] = 0.00021;
  scene.calibration_prior_sigma["depth_scale"] = 0.01;
  scene.timings_s["clouds"] = 0.5;
  scene.warnings = {Message::Verbatim("depth is a little short")};
  return scene;
}

inline const GridShape kGrid{-0.1, -0.2, 0.0015, 120, 80};

inline HeightMap Slope(double offset_m) {
  HeightMap map(kGrid);
  for (std::size_t i = 0; i < map.z.size(); ++i)
    map.z[i] = static_cast<float>(offset_m + 1e-4 * static_cast<double>(i % 120));
  map.z[5] = std::numeric_limits<float>::quiet_NaN();
  return map;
}

inline Comparison Answer() {
  Comparison comparison;
  comparison.preset = Preset::kPaper;
  comparison.current_profile = "unit 61, 3 sweeps";
  comparison.verdict = Verdict::kMove;
  comparison.reasons = {Message::Verbatim("vertical is 9.0 mm off")};
  Alignment alignment;
  alignment.T_reference_current.translation() = Eigen::Vector3d(0.25, 0.5, 0.75);
  alignment.stretch(0, 1) = 0.125;
  alignment.rms_m = 0.001;
  alignment.markers_used = {3, 5, 8};
  alignment.markers_rejected = {{7, 0.012}};
  comparison.alignment = alignment;
  BodyMotion motion;
  motion.T.translation() = Eigen::Vector3d(1, 2, 3);
  motion.covariance(0, 5) = 0.125;
  motion.weak_directions = {{"roll", 2.5, "deg"}};
  motion.residual_median_m = 0.0015;
  motion.residual_p95_m = 0.004;
  comparison.motion = motion;
  Correction correction;
  correction.isocentre_m = Eigen::Vector3d(0.1, 0.2, 0.3);
  correction.value = {-9.0, 2.0, 3.0, 0.1, 0.2, 0.3};
  correction.u95 = {0.5, 0.6, 0.7, 0.01, 0.02, 0.03};
  correction.words[0] = Message::Verbatim("down 9.0 mm");
  comparison.correction = correction;
  comparison.judgements.fill(NumberJudgement::kWithin);
  comparison.judgements[0] = NumberJudgement::kOutside;
  comparison.judgements[2] = NumberJudgement::kUnsure;
  comparison.region = RegionCoverage{0.97, 0.012, Eigen::Vector2d(0.4, 0.5)};
  comparison.limits.min_coverage = 0.85;
  comparison.limits.max_hole_m = 0.04;
  comparison.limits.min_shared_markers = 4;
  comparison.limits.max_lost_s = 0.5;
  comparison.marker_consensus = {.moved_m = 0.004, .moved_sigmas = 2.5};
  comparison.deviation = Slope(0.009);
  comparison.distance = Slope(0.008);
  comparison.current_height = Slope(0.109);
  Deformation deformation;
  deformation.points = {{0.1F, 0.2F, 0.3F}, {0.4F, 0.5F, 0.6F}};
  deformation.shifts_m = {{0.01F, 0.02F, 0.03F}, {0.0F, 0.0F, 0.0F}};
  deformation.observed = {1, 0};
  deformation.shift_p95_m = 0.037;
  comparison.deformation = deformation;
  comparison.timings_s["alignment"] = 0.25;
  return comparison;
}

}  // namespace plumb::testing
