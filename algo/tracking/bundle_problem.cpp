#include "algo/tracking/bundle_problem.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <tbb/parallel_for.h>

#include "algo/base/robust_weights.hpp"
#include "algo/tracking/witnesses.hpp"

namespace plumb::bundle {
namespace {

Eigen::Vector3d PointInCamera(const State& state, const PointView& view) {
  return state.cameras[static_cast<std::size_t>(view.keyframe)].T_camera_world *
         state.landmarks[static_cast<std::size_t>(view.landmark)];
}

/// The indices of the views with each value of a member, ascending.
template <typename View>
std::vector<Problem::Indices> GroupBy(const std::vector<View>& views, int View::*member,
                                      std::size_t num_groups) {
  std::vector<Problem::Indices> groups(num_groups);
  for (std::uint32_t i = 0; i < views.size(); ++i)
    groups[static_cast<std::size_t>(views[i].*member)].push_back(i);
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
  CollectPoints();
  DropViewsBehindCameras();
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

double Problem::PixelWeight() const {
  return 1.0 / (options.keypoint_sigma_px * stated.width / 640.0);
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

void Problem::CollectPoints() {
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
  std::vector<std::size_t> first_view = {0};  // Of each keyframe.
  for (const MapKeyframe& keyframe : map_.keyframes)
    first_view.push_back(
        first_view.back() +
        static_cast<std::size_t>(
            std::count_if(keyframe.keypoints.begin(), keyframe.keypoints.end(), [&](const auto& o) {
              return slot[static_cast<std::size_t>(o.landmark)].has_value();
            })));
  views.resize(first_view.back());
  tbb::parallel_for(std::size_t{0}, map_.keyframes.size(), [&](std::size_t k) {
    std::size_t at = first_view[k];
    for (const KeypointObservation& o : map_.keyframes[k].keypoints) {
      const std::optional<int> s = slot[static_cast<std::size_t>(o.landmark)];
      if (!s) continue;
      PointView& view = views[at++];
      view = {static_cast<int>(k),
              *s,
              o.pixel,
              DepthPlace(o.pixel, stated),
              {o.z_m, o.inverse_depth_slope}};
      if (o.z_m > 0)
        view.weight_z =
            1.0 / (options.keypoint_depth_sigmas * DepthSigma(options.depth_noise, o.z_m, 0.8));
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

void Problem::DropViewsBehindCameras() {
  const State state = Start();
  std::erase_if(views, [&](const PointView& view) {
    return PointInCamera(state, view).z() < kNearestPoint_m;
  });
  std::erase_if(corners, [&](const CornerView& view) {
    return (state.cameras[static_cast<std::size_t>(view.keyframe)].T_camera_world *
            CornerInWorld(state, view))
               .z() < kNearestPoint_m;
  });
  views_of_landmark = GroupBy(views, &PointView::landmark, landmarks.size());
  views_of_keyframe = GroupBy(views, &PointView::keyframe, map_.keyframes.size());
  corners_of_keyframe = GroupBy(corners, &CornerView::keyframe, map_.keyframes.size());
  corners_of_marker = GroupBy(corners, &CornerView::marker, markers.size());
}

Eigen::Vector3d Problem::CornerInWorld(const State& state, const CornerView& view) const {
  return MarkerPose(view.marker) *
         (PoseFromTwist(state.markers[static_cast<std::size_t>(view.marker)]) * view.in_marker);
}

double Problem::DepthDelay(const State& state, int keyframe, double row_fraction) const {
  const Keyframe& data = map_.keyframe(keyframe).data;
  return data.depth_time_s - data.color_time_s + state.calibration.depth[kDepthDelay] +
         row_fraction * state.calibration.depth[kDepthReadout];
}

double Problem::Cost(const State& state) const {
  std::vector<double> parts(map_.keyframes.size(), 0.0);
  tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t k) {
    for (const std::uint32_t i : views_of_keyframe[k]) parts[k] += PointCost(state, views[i]);
    for (const std::uint32_t i : corners_of_keyframe[k]) parts[k] += CornerCost(state, corners[i]);
  });
  std::vector<double> of_terms(terms.size());
  tbb::parallel_for(std::size_t{0}, terms.size(), [&](std::size_t i) {
    const TermVector x = TermState(state, terms[i]);
    of_terms[i] = x.dot(0.5 * (terms[i].H * x) + terms[i].g);
  });
  double cost = 0;
  for (const double part : parts) cost += part;
  for (const double part : of_terms) cost += part;
  if (options.calibrate) cost += options.prior.Cost(ToVector(state.calibration));
  return cost;
}

double Problem::PointCost(const State& state, const PointView& view) const {
  const CameraState& camera = state.cameras[static_cast<std::size_t>(view.keyframe)];
  const Eigen::Vector3d p = PointInCamera(state, view);
  const Eigen::Vector3d motion =
      -(camera.velocity_per_s.head<3>().cross(p) + camera.velocity_per_s.tail<3>());
  const Eigen::Vector3d at_row =
      p + state.calibration.readout_s[0] * view.place.row_fraction * motion;
  if (at_row.z() < kNearestPoint_m) return std::numeric_limits<double>::infinity();
  const SeenPixel seen = ProjectCorrected(stated, state.calibration.lens, at_row);
  const Eigen::Vector2d r = (seen.pixel - view.pixel) * PixelWeight();
  double cost = 0.5 * CauchyLoss(r.squaredNorm(), kKeypointLossScale);
  if (view.depth.z_m > 0) {
    const double late_s = DepthDelay(state, view.keyframe, view.place.row_fraction);
    const double row_s = state.calibration.readout_s[0] * view.place.row_fraction;
    const DepthBeside measured(view.depth,
                               DepthOffset(state, seen.J_point * motion, late_s - row_s));
    const double rz =
        (PredictDepthOnly(state.calibration, p.z() + late_s * motion.z(), view.place) -
         measured.z_m) *
        view.weight_z;
    cost += 0.5 * CauchyLoss(rz * rz, kKeypointLossScale);
  }
  return cost;
}

double Problem::CornerCost(const State& state, const CornerView& view) const {
  const double fraction = RowFraction(view.pixel.y(), stated.height);
  const SeenPoint point =
      See(state.cameras[static_cast<std::size_t>(view.keyframe)], CornerInWorld(state, view),
          state.calibration.readout_s[0] * fraction);
  if (point.p.z() < kNearestPoint_m) return std::numeric_limits<double>::infinity();
  return 0.5 * CauchyLoss(CornerResidual(state, view, point.p).squaredNorm(), kCornerLossScale);
}

Eigen::Vector2d Problem::DepthOffset(const State& state, const Eigen::Vector2d& pixel_velocity,
                                     double later_s) const {
  const auto& depth = state.calibration.depth;
  const Eigen::Vector2d shift_px(depth[kDepthShiftX], depth[kDepthShiftY]);
  return stated.width / 640.0 * shift_px + later_s * pixel_velocity;
}

Eigen::Vector2d Problem::CornerResidual(const State& state, const CornerView& view,
                                        const Eigen::Vector3d& p) const {
  const Eigen::Vector2d pixel = ProjectCorrected(stated, state.calibration.lens, p).pixel;
  return (pixel + state.calibration.edge_bias_px[0] * view.inward - view.pixel) * view.weight;
}

Problem::TermVector Problem::TermState(const State& state, const QuadraticTerm& term) const {
  TermVector x;
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
