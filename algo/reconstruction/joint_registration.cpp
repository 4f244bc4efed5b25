#include "algo/reconstruction/joint_registration.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>
#include <vector>

#include "algo/base/check_stop.hpp"
#include "algo/reconstruction/dense_terms.hpp"
#include "algo/reconstruction/marker_uncertainty.hpp"
#include "algo/tracking/keyframe_link.hpp"
#include "algo/tracking/velocity_refinement.hpp"
#include "algo/tracking/witnesses.hpp"

namespace plumb {
namespace {

// Relative decrease of the cost below which a solution is left to the next round, which changes the
// velocities or the dense terms and therefore the minimum.
constexpr double kPreliminaryTolerance = 1e-3;

// Appends terms that hold weakly constrained keyframes at their tracked poses.
void AddTrackedLinks(const TrackingMap& map, std::vector<QuadraticTerm>& terms) {
  // Standard deviations of depth-only tracking over the next few centimetres of motion. Negligible
  // against the hundreds of observations elsewhere.
  constexpr double kSigma_rad = 0.004;
  constexpr double kSigma_m = 0.006;
  for (std::size_t k = 0; k < map.keyframes.size(); ++k) {
    const MapKeyframe& keyframe = map.keyframes[k];
    if (!keyframe.previous) continue;
    const MapKeyframe& previous = map.keyframe(*keyframe.previous);
    if (IsConstrained(map, keyframe) && IsConstrained(map, previous)) continue;
    const LinkEquations link =
        Linearise({*keyframe.previous, static_cast<int>(k), keyframe.T_previous_color},
                  previous.T_world_color, keyframe.T_world_color, kSigma_rad, kSigma_m);
    QuadraticTerm term;
    term.keyframe_a = *keyframe.previous;
    term.keyframe_b = static_cast<int>(k);
    term.H.topLeftCorner<12, 12>() = link.H;
    term.g.head<12>() = link.g;
    terms.push_back(term);
  }
}

// Errors of a keyframe's motion model are common to all its keypoints. Beyond the number that
// covers the image, more keypoints add no information, and the standard deviation of each grows by
// this factor.
double KeypointSigmaFactor(const TrackingMap& map) {
  constexpr double kEnough = 150.0;  // Keypoints in a keyframe.
  std::size_t count = 0;
  for (const MapKeyframe& keyframe : map.keyframes)
    for (const KeypointObservation& o : keyframe.keypoints) {
      const Landmark& landmark = map.landmark(o.landmark);
      count += landmark.usable && landmark.num_observations > 1 ? 1 : 0;
    }
  const double mean = static_cast<double>(count) / static_cast<double>(map.keyframes.size());
  return std::sqrt(std::max(1.0, mean / kEnough));
}

// The part of a map that the joint solve changes; the images do not belong to it.
class MapState {
 public:
  explicit MapState(const TrackingMap& map) : landmarks_(map.landmarks), markers_(map.markers) {
    for (const MapKeyframe& keyframe : map.keyframes) {
      T_world_color_.push_back(keyframe.T_world_color);
      velocity_per_s_.push_back(keyframe.velocity_per_s);
    }
  }
  // Exchanges this state with that of the map.
  void Exchange(TrackingMap& map) {
    std::swap(map.landmarks, landmarks_);
    std::swap(map.markers, markers_);
    for (std::size_t k = 0; k < map.keyframes.size(); ++k) {
      std::swap(map.keyframes[k].T_world_color, T_world_color_[k]);
      std::swap(map.keyframes[k].velocity_per_s, velocity_per_s_[k]);
    }
  }

 private:
  std::vector<Pose> T_world_color_;
  std::vector<Vector6d> velocity_per_s_;
  std::vector<Landmark> landmarks_;
  std::map<int, MapMarker> markers_;
};

}  // namespace

Pose DepthPose(const MapKeyframe& keyframe, const CalibrationModel& calibration) {
  return PoseAfter(
      keyframe.T_world_color, keyframe.velocity_per_s,
      keyframe.data.depth_time_s - keyframe.data.color_time_s + calibration.depth[kDepthDelay]);
}

JointRegistrationResult RegisterJointly(const Intrinsics& stated,
                                        const JointRegistrationOptions& options, TrackingMap& map,
                                        const std::stop_token& stop) {
  JointRegistrationResult result;
  if (map.keyframes.empty()) return result;
  BundleOptions bundle;
  bundle.marker_length_m = options.marker_length_m;
  bundle.calibrate = options.calibrate;
  bundle.keypoint_sigma_px = options.keypoint_sigma_px * KeypointSigmaFactor(map);
  bundle.keypoint_depth_sigmas = options.keypoint_depth_sigmas;
  bundle.depth_noise = options.depth_noise;
  bundle.prior = options.prior;
  bundle.keep_witnesses_out = options.use_dense;
  if (options.calibrate) MoveCalibration(options.prior.mean, result.calibration);
  bundle.fix_depth_field = !options.use_depth_field;
  bundle.stop = stop;
  bundle.max_iterations = 10;
  bundle.function_tolerance = kPreliminaryTolerance;
  bundle.free_keyframes.resize(map.keyframes.size() - 1);
  std::iota(bundle.free_keyframes.begin(), bundle.free_keyframes.end(), 1);
  std::vector<QuadraticTerm> links;
  AddTrackedLinks(map, links);
  // Solves nothing: only the equations at the present state of the map are needed.
  const auto find_information = [&](const std::vector<QuadraticTerm>& terms) {
    bundle.max_iterations = 0;
    bundle.find_information = true;
    BundleSummary last = BundleAdjust(stated, bundle, terms, map, result.calibration);
    result.marker_sigmas_m = MarkerSigmas(last.posterior, map, options.marker_length_m);
    return last;
  };
  if (map.keyframes.size() < 2) {
    find_information(links);
    return result;
  }
  BundleAdjust(stated, bundle, links, map, result.calibration);
  // The start is close to the solution now: only directions in which poses and calibration change
  // together remain.
  bundle.initial_damping = 1e-7;
  const auto refresh_velocities = [&] {
    if (!options.refresh_velocities) return;
    options.refresh_velocities(map);
    if (!options.use_row_motion) return;
    VelocityOptions velocity;
    velocity.marker_length_m = options.marker_length_m;
    velocity.keypoint_sigma_px = bundle.keypoint_sigma_px;
    velocity.keep_witnesses_out = bundle.keep_witnesses_out;
    RefineVelocities(stated, result.calibration, velocity, map);
  };
  // The lens is estimated here, so the velocities must already be correct.
  for (int round = 0; options.refresh_velocities && round < options.num_velocity_rounds; ++round) {
    refresh_velocities();
    BundleAdjust(stated, bundle, links, map, result.calibration);
  }
  if (!options.use_dense) {
    find_information(links);
    return result;
  }

  const dense::Cells cells = dense::MakeCells(stated, map);
  MapState before(map);
  const CalibrationModel calibration_before = result.calibration;
  double gate_m = options.max_gate_m;
  std::vector<dense::KeyframePair> pairs;
  std::vector<QuadraticTerm> terms;
  bundle.function_tolerance = BundleOptions().function_tolerance;
  // Overlapping surfaces determine the focal length. The rest of the lens, if free here, would
  // follow the errors of the depth model.
  bundle.fix_centre_and_distortion = true;
  for (int round = 0; round < options.num_rounds; ++round) {
    CheckStop(stop);
    refresh_velocities();
    const dense::Sensor sensor = dense::MakeSensor(stated, result.calibration);
    const std::vector<dense::View> views = dense::MakeViews(sensor, result.calibration, cells, map);
    CheckStop(stop);
    if (round == 0) pairs = dense::FindPairs(sensor, options, views, stop);
    // The first round leads to the neighbourhood of the solution.
    const bool is_first = round == 0;
    dense::MakeTerms(sensor, options, map, views, pairs, gate_m,
                     is_first ? dense::Density::kCoarse : dense::Density::kFine, stop, terms);
    bundle.max_iterations = is_first ? 2 : 3;
    AddTrackedLinks(map, terms);
    BundleAdjust(stated, bundle, terms, map, result.calibration);
    CheckStop(stop);
    double farthest_m = 0.0;
    for (const dense::View& view : views)
      farthest_m =
          std::max(farthest_m, (DepthPose(*view.keyframe, result.calibration).translation() -
                                view.T_world_depth.translation())
                                   .norm());
    if (!is_first && farthest_m < options.settled_m) break;
    gate_m = std::max(options.min_gate_m, 0.6 * gate_m);
  }
  result.num_pairs = static_cast<int>(pairs.size());
  const auto consistency = [&](const CalibrationModel& calibration) {
    CheckStop(stop);
    const dense::Sensor sensor = dense::MakeSensor(stated, calibration);
    return dense::Consistency(sensor, dense::MakeViews(sensor, calibration, cells, map), pairs,
                              options.max_gate_m);
  };
  const auto witnesses = [&](const CalibrationModel& calibration) {
    return ErrorsOfWitnesses(stated, calibration, options.marker_length_m, map);
  };
  result.consistency_after_m = consistency(result.calibration);
  result.witnesses_after = witnesses(result.calibration);
  before.Exchange(map);
  result.consistency_before_m = consistency(calibration_before);
  result.witnesses_before = witnesses(calibration_before);
  result.accepted = result.consistency_after_m <= result.consistency_before_m &&
                    !ContradictsWitnesses(result.witnesses_before, result.witnesses_after);
  if (!result.accepted) {
    result.calibration = calibration_before;
    bundle.fix_centre_and_distortion = false;
    find_information(links);
    return result;
  }
  before.Exchange(map);
  BundleSummary last = find_information(terms);
  if (options.calibrate) {
    result.evidence.solution = ToVector(result.calibration);
    result.evidence.information = last.information;
    result.posterior = std::move(last.posterior);
  }
  return result;
}

}  // namespace plumb
