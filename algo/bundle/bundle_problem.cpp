// SPDX-License-Identifier: Apache-2.0
#include "algo/bundle/bundle_problem.hpp"

#include <algorithm>
#include <cmath>

#include <tbb/parallel_for.h>

#include "algo/bundle/witnesses.hpp"

namespace plumb::bundle {
namespace {

// Keypoints with depth of a usual keyframe.
constexpr double kReadingsOfImage = 150.0;

const CameraState& CameraOf(const State& state, const auto& term) {
  return state.cameras[static_cast<std::size_t>(term.keyframe)];
}

const Eigen::Vector3d& LandmarkOf(const State& state, const KeypointTerm& term) {
  return state.landmarks[static_cast<std::size_t>(term.landmark)];
}

/// The indices of the terms with each value of a member, ascending.
template <typename Term>
std::vector<Problem::Indices> GroupBy(const std::vector<Term>& terms, int Term::*member,
                                      std::size_t num_groups) {
  std::vector<Problem::Indices> groups(num_groups);
  for (std::uint32_t i = 0; i < terms.size(); ++i)
    groups[static_cast<std::size_t>(terms[i].*member)].push_back(i);
  return groups;
}

}  // namespace

Problem::Problem(const Intrinsics& stated_camera, const BundleOptions& bundle_options,
                 const std::vector<QuadraticTerm>& quadratic_terms, TrackingMap& map,
                 CalibrationModel& calibration)
    : stated(stated_camera),
      options(bundle_options),
      terms(quadratic_terms),
      pose_slots(map.keyframes.size()),
      map_(map),
      calibration_(calibration) {
  for (const int k : options.free_keyframes) {
    std::optional<int>& slot = pose_slots[static_cast<std::size_t>(k)];
    if (slot) continue;
    slot = static_cast<int>(free.size());
    free.push_back(k);
  }
  CollectMarkers();
  CollectKeypoints();
  DropTermsBehindCameras();
  markers_at = kCamera * static_cast<Eigen::Index>(free.size());
  calibration_at = markers_at + 6 * static_cast<Eigen::Index>(markers.size());
  size = calibration_at + (options.calibrate ? kCalibrationSize : 0);
}

const Pose& Problem::MarkerPose(int slot) const {
  return T_world_marker0_[static_cast<std::size_t>(slot)];
}

std::optional<Eigen::Index> Problem::CameraAt(int keyframe) const {
  const std::optional<int> slot = PoseSlot(keyframe);
  if (!slot) return std::nullopt;
  return kCamera * static_cast<Eigen::Index>(*slot);
}

void Problem::CollectMarkers() {
  const auto collect = [&](const MapKeyframe& keyframe) {
    for (const MarkerObservation& m : keyframe.data.markers)
      if (map_.markers.contains(m.id)) markers.try_emplace(m.id, 0);
  };
  for (const int k : free) collect(map_.keyframe(k));
  if (options.find_information) std::ranges::for_each(map_.keyframes, collect);
  for (const QuadraticTerm& term : terms)
    if (term.marker) markers.try_emplace(*term.marker, 0);
  int slot = 0;
  for (auto& [id, index] : markers) {
    index = slot++;
    T_world_marker0_.push_back(map_.markers.at(id).T_world_marker);
  }
  const MarkerCorners in_marker = CornersInMarkerFrame(options.marker_length_m);
  const double scale = stated.width / 640.0;
  for (std::size_t k = 0; k < map_.keyframes.size(); ++k) {
    for (const MarkerObservation& m : map_.keyframes[k].data.markers) {
      const auto found = markers.find(m.id);
      if (found == markers.end()) continue;
      if (options.keep_witnesses_out && IsWitness(map_.markers.at(m.id), m.id, static_cast<int>(k)))
        continue;
      for (std::size_t i = 0; i < 4; ++i)
        corners.push_back({static_cast<int>(k), found->second, in_marker[i], m.corners[i],
                           scale * Inward(m.corners, i),
                           1.0 / std::max(options.min_corner_sigma_px * scale, m.sigma_px[i])});
    }
  }
}

void Problem::CollectKeypoints() {
  // The landmarks that a free keyframe observes, and all observations of them. A landmark with only
  // one observation constrains nothing.
  std::vector<std::optional<int>> slot(map_.landmarks.size());
  for (const int k : free) {
    for (const KeypointObservation& o : map_.keyframe(k).keypoints) {
      const Landmark& landmark = map_.landmark(o.landmark);
      if (options.keep_witnesses_out && IsWitness(landmark, o.landmark)) continue;
      std::optional<int>& s = slot[static_cast<std::size_t>(o.landmark)];
      if (s || !landmark.usable || landmark.num_observations < 2) continue;
      s = static_cast<int>(landmarks.size());
      landmarks.push_back(o.landmark);
    }
  }
  std::vector<std::size_t> first_term = {0};  // Of each keyframe.
  for (const MapKeyframe& keyframe : map_.keyframes)
    first_term.push_back(
        first_term.back() +
        static_cast<std::size_t>(
            std::count_if(keyframe.keypoints.begin(), keyframe.keypoints.end(), [&](const auto& o) {
              return slot[static_cast<std::size_t>(o.landmark)].has_value();
            })));
  keypoints.resize(first_term.back());
  const double weight_px = 1.0 / (options.keypoint_sigma_px * stated.width / 640.0);
  tbb::parallel_for(std::size_t{0}, map_.keyframes.size(), [&](std::size_t k) {
    std::size_t at = first_term[k];
    const Keyframe& data = map_.keyframes[k].data;
    for (const KeypointObservation& o : map_.keyframes[k].keypoints) {
      const std::optional<int> s = slot[static_cast<std::size_t>(o.landmark)];
      if (!s) continue;
      KeypointTerm& term = keypoints[at++];
      term = {.keyframe = static_cast<int>(k),
              .landmark = *s,
              .pixel = o.pixel,
              .place = DepthPlace(o.pixel, stated),
              .depth = {o.z_m, o.inverse_depth_slope},
              .weight_px = weight_px,
              .depth_after_color_s = data.depth_time_s - data.color_time_s};
      // With this, all readings of an image together have the information of its own error.
      if (o.z_m > 0)
        term.weight_z =
            1.0 /
            std::hypot(options.keypoint_depth_sigmas * DepthSigma(options.depth_noise, o.z_m, 0.8),
                       std::sqrt(kReadingsOfImage) * options.shared_depth_sigma_m);
    }
  });
}

State Problem::Start() const {
  State state;
  for (const MapKeyframe& keyframe : map_.keyframes) {
    CameraState camera;
    camera.T_camera0_world = keyframe.T_world_color.inverse();
    camera.velocity_per_s = keyframe.velocity_per_s;
    camera.Prepare();
    state.cameras.push_back(camera);
  }
  state.markers.assign(markers.size(), Vector6d::Zero());
  for (const int id : landmarks) state.landmarks.push_back(map_.landmark(id).p_world);
  state.calibration = calibration_;
  return state;
}

void Problem::DropTermsBehindCameras() {
  const State state = Start();
  std::erase_if(keypoints, [&](const KeypointTerm& term) {
    return (CameraOf(state, term).T_camera_world * LandmarkOf(state, term)).z() < kNearestPoint_m;
  });
  std::erase_if(corners, [&](const CornerTerm& term) {
    return (CameraOf(state, term).T_camera_world * term.InWorld(StateOf(state, term))).z() <
           kNearestPoint_m;
  });
  keypoints_of_landmark = GroupBy(keypoints, &KeypointTerm::landmark, landmarks.size());
  keypoints_of_keyframe = GroupBy(keypoints, &KeypointTerm::keyframe, map_.keyframes.size());
  corners_of_keyframe = GroupBy(corners, &CornerTerm::keyframe, map_.keyframes.size());
  corners_of_marker = GroupBy(corners, &CornerTerm::marker, markers.size());
}

MarkerState Problem::StateOf(const State& state, const CornerTerm& term) const {
  return {MarkerPose(term.marker), state.markers[static_cast<std::size_t>(term.marker)]};
}

double Problem::Cost(const State& state) const {
  std::vector<double> parts(map_.keyframes.size(), 0.0);
  tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t k) {
    for (const std::uint32_t i : keypoints_of_keyframe[k]) parts[k] += Cost(state, keypoints[i]);
    for (const std::uint32_t i : corners_of_keyframe[k]) parts[k] += Cost(state, corners[i]);
  });
  std::vector<double> of_terms(terms.size());
  tbb::parallel_for(std::size_t{0}, terms.size(), [&](std::size_t i) {
    of_terms[i] = terms[i].Cost(TermState(state, terms[i]));
  });
  double cost = 0;
  for (const double part : parts) cost += part;
  for (const double part : of_terms) cost += part;
  if (options.calibrate) cost += options.prior.Cost(ToVector(state.calibration));
  return cost;
}

double Problem::Cost(const State& state, const KeypointTerm& term) const {
  return term.Cost(stated, state.calibration, CameraOf(state, term), LandmarkOf(state, term));
}

double Problem::Cost(const State& state, const CornerTerm& term) const {
  return term.Cost(stated, state.calibration, CameraOf(state, term), StateOf(state, term));
}

KeypointTerm::Rows Problem::Linearise(const State& state, const KeypointTerm& term) const {
  return term.Linearise(stated, state.calibration, CameraOf(state, term), LandmarkOf(state, term));
}

CornerTerm::Rows Problem::Linearise(const State& state, const CornerTerm& term) const {
  return term.Linearise(stated, state.calibration, CameraOf(state, term), StateOf(state, term));
}

QuadraticTerm::Vector Problem::TermState(const State& state, const QuadraticTerm& term) const {
  QuadraticTerm::Vector x;
  x.head<6>() = state.cameras[static_cast<std::size_t>(term.keyframe_a)].twist;
  x.segment<6>(QuadraticTerm::kTwistB) =
      term.keyframe_b ? state.cameras[static_cast<std::size_t>(*term.keyframe_b)].twist
                      : state.markers[static_cast<std::size_t>(markers.at(term.marker.value()))];
  for (int i = 0; i < QuadraticTerm::kFocal; ++i)
    x[QuadraticTerm::kFocalAt + i] = state.calibration.lens[static_cast<std::size_t>(i)] -
                                     calibration_.lens[static_cast<std::size_t>(i)];
  for (int i = 0; i < CalibrationModel::kDepthSize; ++i)
    x[QuadraticTerm::kDepthCalibrationAt + i] =
        state.calibration.depth[static_cast<std::size_t>(i)] -
        calibration_.depth[static_cast<std::size_t>(i)];
  return x;
}

void Problem::Write(const State& state) const {
  for (const int k : free) {
    MapKeyframe& keyframe = map_.keyframe(k);
    keyframe.T_world_color = Orthonormalised(
        keyframe.T_world_color * PoseFromTwist(state.cameras[static_cast<std::size_t>(k)].twist));
  }
  for (const auto& [id, slot] : markers) {
    MapMarker& marker = map_.markers.at(id);
    marker.T_world_marker = Orthonormalised(
        marker.T_world_marker * PoseFromTwist(state.markers[static_cast<std::size_t>(slot)]));
  }
  for (std::size_t s = 0; s < landmarks.size(); ++s)
    map_.landmark(landmarks[s]).p_world = state.landmarks[s];
  calibration_ = state.calibration;
}

}  // namespace plumb::bundle
