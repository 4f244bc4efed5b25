// SPDX-License-Identifier: Apache-2.0
#include "algo/registration/joint_registration.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>
#include <vector>

#include "algo/base/check_stop.hpp"
#include "algo/bundle/witnesses.hpp"
#include "algo/registration/dense_terms.hpp"
#include "algo/registration/marker_uncertainty.hpp"
#include "algo/registration/tracked_links.hpp"
#include "algo/registration/velocity_refinement.hpp"

namespace plumb {
namespace {

// Relative decrease of the cost below which a solution is left to the next round, which changes the
// velocities or the dense terms and therefore the minimum.
constexpr double kPreliminaryTolerance = 1e-3;
// Iterations of one solution. The first dense round leads to the neighbourhood of the solution
// only.
constexpr int kMaxIterations = 10;
constexpr int kCoarseIterations = 2;
constexpr int kFineIterations = 3;
// Once the start is close to the solution, only directions in which poses and calibration change
// together remain, and these need little damping.
constexpr double kDampingNearSolution = 1e-7;
constexpr double kGateShrinks = 0.6;  // In each round.

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

// One call of RegisterJointly().
class JointRegistration {
 public:
  JointRegistration(const Intrinsics& stated, const JointRegistrationOptions& options,
                    TrackingMap& map, const std::stop_token& stop)
      : stated_(stated), options_(options), map_(map), stop_(stop) {
    if (options.calibrate) MoveCalibration(options.prior.mean, result_.calibration);
  }

  JointRegistrationResult Run() {
    if (map_.keyframes.size() > 1) {
      SolveSparse();
      SolveWithNewVelocities();
      if (options_.use_dense && SolveDense()) {
        FindInformation(DenseBundle(), dense_terms_, true);
        return std::move(result_);
      }
    }
    FindInformation(SparseBundle(), TrackedLinks(), false);
    return std::move(result_);
  }

 private:
  // Keypoints, markers and the whole calibration.
  [[nodiscard]] BundleOptions SparseBundle() const {
    BundleOptions bundle;
    bundle.marker_length_m = options_.marker_length_m;
    bundle.calibrate = options_.calibrate;
    bundle.keypoint_sigma_px = keypoint_sigma_px_;
    bundle.keypoint_depth_sigmas = options_.keypoint_depth_sigmas;
    bundle.shared_depth_sigma_m = options_.image_offset_sigma_m;
    bundle.depth_noise = options_.depth_noise;
    bundle.prior = options_.prior;
    bundle.keep_witnesses_out = options_.use_dense;
    bundle.fix_depth_field = !options_.use_depth_field;
    bundle.stop = stop_;
    bundle.max_iterations = kMaxIterations;
    bundle.function_tolerance = kPreliminaryTolerance;
    bundle.free_keyframes.resize(map_.keyframes.size() - 1);
    std::iota(bundle.free_keyframes.begin(), bundle.free_keyframes.end(), 1);
    return bundle;
  }

  // Overlapping surfaces determine the focal length. The rest of the lens, if free here, would
  // follow the errors of the depth model.
  [[nodiscard]] BundleOptions DenseBundle() const {
    BundleOptions bundle = SparseBundle();
    bundle.fix_centre_and_distortion = true;
    bundle.function_tolerance = BundleOptions().function_tolerance;
    bundle.initial_damping = kDampingNearSolution;
    return bundle;
  }

  // At the present state of the map.
  [[nodiscard]] std::vector<QuadraticTerm> TrackedLinks() const {
    std::vector<QuadraticTerm> links;
    AddTrackedLinks(map_, links);
    return links;
  }

  void SolveSparse() {
    BundleAdjust(stated_, SparseBundle(), TrackedLinks(), map_, result_.calibration);
  }

  // The lens is estimated here, so the velocities must already be correct.
  void SolveWithNewVelocities() {
    if (!options_.refresh_velocities) return;
    BundleOptions bundle = SparseBundle();
    bundle.initial_damping = kDampingNearSolution;
    for (int round = 0; round < options_.num_velocity_rounds; ++round) {
      RefreshVelocities();
      BundleAdjust(stated_, bundle, TrackedLinks(), map_, result_.calibration);
    }
  }

  void RefreshVelocities() {
    if (!options_.refresh_velocities) return;
    options_.refresh_velocities(map_);
    if (!options_.use_row_motion) return;
    VelocityOptions velocity;
    velocity.marker_length_m = options_.marker_length_m;
    velocity.keypoint_sigma_px = keypoint_sigma_px_;
    velocity.keep_witnesses_out = options_.use_dense;
    RefineVelocities(stated_, result_.calibration, velocity, map_);
  }

  // False: the map and the calibration are as they were.
  bool SolveDense() {
    cells_ = dense::MakeCells(stated_, map_);
    MapState other(map_);
    CalibrationModel other_calibration = result_.calibration;
    result_.sparse_calibration = result_.calibration;
    for (const MapKeyframe& keyframe : map_.keyframes)
      result_.T_world_depth_sparse.push_back(DepthPose(keyframe, result_.calibration));
    RunDenseRounds();
    result_.consistency_after_m = Consistency(result_.depth_errors);
    result_.witnesses_after = Witnesses();
    other.Exchange(map_);
    std::swap(other_calibration, result_.calibration);
    dense::DepthErrors errors_before;
    result_.consistency_before_m = Consistency(errors_before);
    result_.witnesses_before = Witnesses();
    result_.accepted =
        dense::AsConsistent(result_.consistency_before_m, result_.consistency_after_m) &&
        !ContradictsWitnesses(result_.witnesses_before, result_.witnesses_after);
    if (!result_.accepted) {
      result_.depth_errors = std::move(errors_before);
      return false;
    }
    other.Exchange(map_);
    std::swap(other_calibration, result_.calibration);
    return true;
  }

  // Associates and solves in turn, with a gate that shrinks.
  void RunDenseRounds() {
    BundleOptions bundle = DenseBundle();
    double gate_m = options_.max_gate_m;
    for (int round = 0; round < options_.num_rounds; ++round) {
      CheckStop(stop_);
      RefreshVelocities();
      const dense::Sensor sensor = dense::MakeSensor(stated_, result_.calibration);
      std::vector<dense::View> views = dense::MakeViews(sensor, result_.calibration, cells_, map_);
      CheckStop(stop_);
      const bool is_first = round == 0;
      if (is_first) pairs_ = dense::FindPairs(sensor, options_, views, stop_);
      const dense::DepthErrors errors = CorrectImages(sensor, views);
      dense::MakeTerms(sensor, options_, map_, views, pairs_, gate_m,
                       is_first ? dense::Density::kCoarse : dense::Density::kFine, errors, stop_,
                       dense_terms_);
      AddTrackedLinks(map_, dense_terms_);
      bundle.max_iterations = is_first ? kCoarseIterations : kFineIterations;
      BundleAdjust(stated_, bundle, dense_terms_, map_, result_.calibration);
      CheckStop(stop_);
      if (!is_first && FarthestMove(views) < options_.settled_m) break;
      gate_m = std::max(options_.min_gate_m, kGateShrinks * gate_m);
    }
    result_.num_pairs = static_cast<int>(pairs_.size());
  }

  // Finds the errors that images have of their own where the views are, and corrects the views.
  dense::DepthErrors CorrectImages(const dense::Sensor& sensor,
                                   std::vector<dense::View>& views) const {
    dense::DepthErrors errors =
        dense::FindDepthErrors(sensor, options_, map_, views, pairs_, options_.max_gate_m, stop_);
    if (!errors.images.empty())
      views = dense::MakeViews(sensor, result_.calibration, cells_, map_, errors);
    return errors;
  }

  // Of the depth cameras, since the views were made.
  [[nodiscard]] double FarthestMove(const std::vector<dense::View>& views) const {
    double farthest_m = 0.0;
    for (const dense::View& view : views)
      farthest_m =
          std::max(farthest_m, (DepthPose(*view.keyframe, result_.calibration).translation() -
                                view.T_world_depth.translation())
                                   .norm());
    return farthest_m;
  }

  // Of the held-out cells, at the present state.
  // @param errors  Of the images at that state.
  [[nodiscard]] double Consistency(dense::DepthErrors& errors) const {
    CheckStop(stop_);
    const dense::Sensor sensor = dense::MakeSensor(stated_, result_.calibration);
    std::vector<dense::View> views = dense::MakeViews(sensor, result_.calibration, cells_, map_);
    errors = CorrectImages(sensor, views);
    return dense::Consistency(sensor, views, pairs_, options_.max_gate_m);
  }
  [[nodiscard]] WitnessErrors Witnesses() const {
    return ErrorsOfWitnesses(stated_, result_.calibration, options_.marker_length_m, map_);
  }

  // Solves nothing: only the equations at the present state of the map are needed.
  void FindInformation(BundleOptions bundle, const std::vector<QuadraticTerm>& terms,
                       bool with_dense_terms) {
    bundle.max_iterations = 0;
    bundle.find_information = true;
    BundleSummary last = BundleAdjust(stated_, bundle, terms, map_, result_.calibration);
    result_.marker_sigmas_m = MarkerSigmas(last.posterior, map_, options_.marker_length_m);
    if (!with_dense_terms || !options_.calibrate) return;
    result_.evidence.solution = ToVector(result_.calibration);
    result_.evidence.information = last.information;
    result_.posterior = std::move(last.posterior);
    const dense::Sensor sensor = dense::MakeSensor(stated_, result_.calibration);
    result_.depth_errors_with_calibration = dense::FindDepthErrorColumns(
        sensor, options_, map_, dense::MakeViews(sensor, result_.calibration, cells_, map_), pairs_,
        options_.max_gate_m, result_.posterior, stop_);
  }

  const Intrinsics& stated_;
  const JointRegistrationOptions& options_;
  TrackingMap& map_;
  const std::stop_token& stop_;
  // Of the landmarks that tracking left, for all phases.
  double keypoint_sigma_px_ = options_.keypoint_sigma_px * KeypointSigmaFactor(map_);
  dense::Cells cells_;
  std::vector<dense::KeyframePair> pairs_;
  std::vector<QuadraticTerm> dense_terms_;
  JointRegistrationResult result_;
};

}  // namespace

JointRegistrationResult RegisterJointly(const Intrinsics& stated,
                                        const JointRegistrationOptions& options, TrackingMap& map,
                                        const std::stop_token& stop) {
  if (map.keyframes.empty()) return {};
  return JointRegistration(stated, options, map, stop).Run();
}

}  // namespace plumb
