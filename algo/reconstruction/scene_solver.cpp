// SPDX-License-Identifier: Apache-2.0
#include "algo/reconstruction/scene_solver.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <opencv2/core.hpp>

#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/statistics.hpp"
#include "algo/diagnosis/marker_depth.hpp"
#include "algo/diagnosis/sweep_watch.hpp"
#include "algo/markers/sweep_tone.hpp"
#include "algo/motion/region.hpp"
#include "algo/published/paper_reconstruction.hpp"
#include "algo/reconstruction/breathing.hpp"
#include "algo/reconstruction/breathing_check.hpp"
#include "algo/reconstruction/scene_assembly.hpp"
#include "algo/reconstruction/trajectory.hpp"
#include "algo/registration/corrected_views.hpp"
#include "algo/registration/joint_registration.hpp"
#include "algo/registration/sensor_sensitivity.hpp"
#include "algo/sensor_model/image_error_sigmas.hpp"
#include "algo/surface/height_maps.hpp"
#include "algo/surface/surface_cloud.hpp"
#include "algo/surface/surface_mesh.hpp"
#include "algo/surface/view_surface.hpp"
#include "algo/tracking/map_budget.hpp"
#include "algo/tracking/tracker.hpp"
#include "algo/types/marker_dictionary.hpp"
#include "words/progress.hpp"
#include "words/reconstruction.hpp"

namespace plumb {
namespace {

constexpr std::size_t kMaxPaperKeyframes = 20;  // The paper had about 15 a sweep.
// Errors of marker edges once the tone curve and the edge shift have been measured: what remains is
// the variation with blur and exposure.
constexpr double kMeasuredEdgeSigma_px = 0.01;

// States why the scene contains no points. The depth is the median over the frames' medians.
Message WhyNoSurface(std::span<const ViewSurface> surfaces, std::vector<double> median_depths_m,
                     const UsableDepth& range) {
  const double median_depth_m = TakeMedian(median_depths_m);
  const bool measured =
      std::any_of(surfaces.begin(), surfaces.end(), [](const ViewSurface& surface) {
        return std::any_of(surface.pixels.begin(), surface.pixels.end(),
                           [](const ViewSurface::Pixel& pixel) { return pixel.weight > 0; });
      });
  if (measured) return say::reconstruction::NoCommonSurface(surfaces.size(), median_depth_m);
  return say::reconstruction::NoSurface(surfaces.size(), median_depth_m, range.nearest_m,
                                        range.farthest_m);
}

// Standard deviation of the markers' edges after the sweep's tone curve has been taken into
// account.
double EdgeSigma(const std::optional<SweepTone>& tone) {
  if (!tone.has_value()) return CalibrationModel::kEdgeBiasSigma;
  return std::hypot(kMeasuredEdgeSigma_px, tone.value().sigma_edge_shift_px);
}

// States how well the sweep determined each term of the calibration.
// @param information  Of the sweep alone; zero if nothing was accepted.
void StateSigmas(const CalibrationMatrix& information, const CalibrationMatrix& prior,
                 Scene& scene) {
  const std::optional<CalibrationVector> before = SigmasOf(prior);
  const std::optional<CalibrationVector> after = SigmasOf(information + prior);
  if (!before || !after || information.isZero(0.0)) return;
  for (int i = 0; i < kCalibrationSize; ++i) {
    const std::string& name = CalibrationNames()[static_cast<std::size_t>(i)];
    scene.calibration_prior_sigma[name] = (*before)[i];
    scene.calibration_sigma[name] = (*after)[i];
  }
}

// What is known of the class's depth images beside the calibration.
void ApplyClass(DepthSensor sensor, JointRegistrationOptions& options) {
  options.correlation_px = ClassOf(sensor).correlation_px;
  const ImageErrorSigmas& image = ImageErrorSigmasOf(sensor);
  options.image_offset_sigma_m = image.offset_m;
  options.image_tilt_sigma = image.tilt;
  options.depth_curve_sigma_m = image.curve_m;
}

// How far the solved calibration is from its prior.
CalibrationFit FitOf(const CalibrationVector& solved, const CalibrationPrior& prior) {
  const std::optional<CalibrationVector> sigmas = SigmasOf(prior.information);
  if (!sigmas) return {};
  CalibrationFit fit;
  fit.chi2 = 2 * prior.Cost(solved);
  fit.num_terms = prior.num_terms;
  int worst = 0;
  (solved - prior.mean).cwiseQuotient(*sigmas).cwiseAbs().maxCoeff(&worst);
  fit.worst_term = CalibrationNames()[static_cast<std::size_t>(worst)];
  fit.worst_value = solved[worst] - prior.mean[worst];
  fit.worst_sigma = (*sigmas)[worst];
  constexpr int kDelayAt = kDepthAt + kDepthDelay;
  fit.delay_s = solved[kDelayAt] - prior.mean[kDelayAt];
  return fit;
}

// One call of SolveScene().
class SceneSolver {
 public:
  SceneSolver(TrackedSweep sweep, const std::stop_token& stop,
              const std::function<void(double, const Message&)>& progress)
      : sweep_(std::move(sweep)), stop_(stop), progress_(progress) {}

  Scene Solve() {
    const double start = Now();
    const Report report = [this](double fraction, const Message& what) {
      CheckStop(stop_);
      if (progress_) progress_(fraction, what);
    };
    std::vector<TrackedFrame>& frames = sweep_.frames;
    TrackingMap& map = sweep_.map;
    if (frames.size() < 2) throw DataError(say::reconstruction::FewFrames(frames.size()));
    if (sweep_.median_depths_m.empty())
      throw DataError(say::reconstruction::NoDepth(frames.size()));
    if (map.keyframes.empty()) throw DataError(say::reconstruction::NothingSeen(frames.size()));
    BoundKeyframes(sweep_.options.max_keyframes, ColorPoses(frames, map), frames, map);
    RefreshVelocities(frames, map);

    Scene scene = sweep_.options.preset == Preset::kPaper
                      ? ReconstructPaper(frames, map, stop_, report)
                      : ReconstructBest(frames, map, stop_, report);
    report(0.9, say::progress::Mesh());
    const double stage = Now();
    constexpr int kDecimation = 2;
    if (scene.height_map)
      scene.mesh = MeshOfHeightMap(*scene.height_map,
                                   ColorsFromCloud(*scene.height_map, scene.cloud, kDecimation),
                                   {.decimation = kDecimation});
    scene.timings_s["mesh"] = Now() - stage;
    if (!sweep_.tracking_times_s.empty())
      scene.timings_s["tracking_per_frame_median"] = TakeMedian(sweep_.tracking_times_s);
    scene.timings_s["after_last_frame"] = Now() - start;
    report(1.0, say::progress::Done());
    return scene;
  }

 private:
  using Report = std::function<void(double, const Message&)>;

  [[nodiscard]] double Now() const { return sweep_.options.now_s ? sweep_.options.now_s() : 0.0; }

  // Estimates the camera's tone curve and measures the keyframes' markers again with it; tracking
  // assumed the sRGB curve.
  [[nodiscard]] std::optional<SweepTone> RefineMarkers(TrackingMap& map,
                                                       const std::stop_token& stop) const {
    if (!sweep_.options.use_markers) return std::nullopt;
    const MarkerDictionary dictionary =
        MarkerDictionary::ByName(sweep_.info.room_markers.dictionary);
    std::vector<MarkerSighting> sightings;
    std::vector<MarkerObservation*> observations;
    for (MapKeyframe& keyframe : map.keyframes) {
      if (keyframe.gray.empty()) continue;
      for (MarkerObservation& observation : keyframe.data.markers) {
        observations.push_back(&observation);
        sightings.push_back({keyframe.gray,
                             observation.corners,
                             {dictionary.Code(observation.id), dictionary.bits_per_side()}});
      }
    }
    const std::optional<SweepTone> tone = EstimateTone(sightings, stop);
    if (!tone) return std::nullopt;
    tbb::parallel_for(std::size_t{0}, sightings.size(), [&](std::size_t i) {
      CornerRefinementOptions refinement;
      refinement.tone = &tone->table;
      refinement.edge_shift_px = tone->edge_shift_px;
      const auto refined =
          RefineCorners(sightings[i].gray, sightings[i].corners, sightings[i].pattern, refinement);
      if (!refined) return;
      observations[i]->corners = refined->corners;
      observations[i]->sigma_px = refined->sigma_px;
    });
    return tone;
  }

  [[nodiscard]] Scene ReconstructBest(std::vector<TrackedFrame>& frames, TrackingMap& map,
                                      const std::stop_token& stop, const Report& report) const {
    report(0.0, say::progress::Markers());
    double stage = Now();
    const std::optional<SweepTone> tone =
        sweep_.options.use_tone_curve ? RefineMarkers(map, stop) : std::nullopt;
    const double tone_s = Now() - stage;
    ReleaseImages(map);
    report(0.05, say::progress::Registration());
    stage = Now();
    const JointRegistrationOptions joint_options = JointOptions(tone, frames);
    Symptoms symptoms = SymptomsBefore(joint_options.prior, map);
    const JointRegistrationResult joint =
        RegisterJointly(sweep_.info.intrinsics, joint_options, map, stop);
    const double joint_s = Now() - stage;
    stage = Now();
    if (sweep_.options.on_learned && joint.accepted)
      sweep_.options.on_learned(Learn(
          sweep_.options.profile.value_or(ProfileOfAnyUnit(sweep_.info.intrinsics, Unit(frames))),
          joint_options.prior, joint.evidence));
    Scene scene = MakeScene({.info = sweep_.info,
                             .preset = sweep_.options.preset,
                             .num_dropped = sweep_.num_dropped,
                             .frames = frames,
                             .map = map,
                             .calibration = joint.calibration,
                             .marker_sigmas_m = joint.marker_sigmas_m,
                             .T_scene_world = SceneFromWorld(sweep_.info, map)});
    WarnOfFrame(sweep_.info, map, scene);
    StateSensor(joint, map, scene);
    StateCalibration(joint, joint_options.prior, tone, scene);
    symptoms.calibration = FitOf(ToVector(joint.calibration), joint_options.prior);
    AddFindings(symptoms, scene);
    scene.timings_s["tone_curve"] = tone_s;
    scene.timings_s["global_registration"] = joint_s;
    // The joint solve has used the markers; they now place the keyframes in the scene's frame.
    scene.timings_s["markers"] = Now() - stage;
    MakeSurfaces(joint, map, stop, report, scene);
    return scene;
  }

  // What the sweep shows before anything is solved.
  [[nodiscard]] Symptoms SymptomsBefore(const CalibrationPrior& prior,
                                        const TrackingMap& map) const {
    Symptoms symptoms = sweep_.watch.Finish(
        sweep_.info, std::ranges::any_of(map.keyframes, [](const MapKeyframe& keyframe) {
          return !keyframe.data.markers.empty();
        }));
    if (!sweep_.options.use_markers) return symptoms;
    CalibrationModel known;
    MoveCalibration(prior.mean, known);
    symptoms.marker_depths =
        MeasureMarkerDepths(map, sweep_.info.intrinsics, known, sweep_.info.room_markers.length_m);
    symptoms.depth_layout =
        FindDepthLayout(map, sweep_.info.intrinsics, known, sweep_.info.room_markers.length_m);
    return symptoms;
  }

  // The joint solve needs as much memory as the images, so what it does not use is released first.
  static void ReleaseImages(TrackingMap& map) {
    for (MapKeyframe& keyframe : map.keyframes) {
      keyframe.gray.release();
      keyframe.descriptors.release();
    }
  }

  // @param frames  Must outlive the sweep_.options.
  [[nodiscard]] JointRegistrationOptions JointOptions(const std::optional<SweepTone>& tone,
                                                      std::vector<TrackedFrame>& frames) const {
    JointRegistrationOptions joint_options;
    joint_options.marker_length_m = sweep_.info.room_markers.length_m;
    joint_options.depth_noise = sweep_.info.depth_noise;
    ApplyClass(sweep_.info.depth_sensor, joint_options);
    joint_options.use_depth_field = sweep_.options.use_depth_field;
    joint_options.use_dense = sweep_.options.use_dense_depth;
    joint_options.use_row_motion = sweep_.options.use_row_motion;
    joint_options.refresh_velocities = [&frames](TrackingMap& moved) {
      RefreshVelocities(frames, moved);
    };
    const double edge_sigma_px = EdgeSigma(tone);
    joint_options.prior =
        sweep_.options.profile
            ? PriorOfNextSweep(*sweep_.options.profile, sweep_.info.intrinsics, edge_sigma_px)
            : PriorOfAnyUnit(edge_sigma_px, Unit(frames));
    return joint_options;
  }

  [[nodiscard]] UnitKnowledge Unit(const std::vector<TrackedFrame>& frames) const {
    return {.sensor = sweep_.info.depth_sensor,
            .lens_stated_straight = !HasLens(sweep_.info.intrinsics),
            .one_stamp = std::ranges::all_of(frames, [](const TrackedFrame& frame) {
              return frame.color_time_s == frame.depth_time_s;
            })};
  }

  // States the profile from which the sweep started, and how the scene depends on the sensor.
  void StateSensor(const JointRegistrationResult& joint, const TrackingMap& map,
                   Scene& scene) const {
    if (scene.frame == SceneFrame::kReferenceMarker && !joint.posterior.empty()) {
      scene.sensitivity = SensitivityOf(sweep_.info.intrinsics, joint.calibration, joint.posterior,
                                        joint.depth_errors_with_calibration, map,
                                        *sweep_.info.room_markers.reference);
      scene.sensitivity->stated_for_this_unit = !sweep_.info.intrinsics_assumed;
      scene.sensitivity->serial = sweep_.options.sensor_serial;
    }
    if (sweep_.options.profile)
      scene.sensor_profile = fmt::format("{}, {} sweep{}", sweep_.options.profile->name,
                                         sweep_.options.profile->num_sweeps,
                                         sweep_.options.profile->num_sweeps == 1 ? "" : "s");
  }

  // States what the sweep found out about the sensor, and the evidence for it.
  static void StateCalibration(const JointRegistrationResult& joint, const CalibrationPrior& prior,
                               const std::optional<SweepTone>& tone, Scene& scene) {
    for (const auto& [name, value] : joint.calibration.Named()) scene.calibration[name] = value;
    StateSigmas(joint.evidence.information, prior.information, scene);
    if (tone) {
      scene.calibration["tone_gamma"] = tone->gamma;
      scene.calibration["marker_edge_shift_px"] = tone->edge_shift_px;
      scene.calibration["marker_edge_shift_sigma_px"] = tone->sigma_edge_shift_px;
      scene.calibration["tone_gamma_sigma"] = tone->sigma_gamma;
    }
    scene.calibration["consistency_before_m"] = joint.consistency_before_m;
    scene.calibration["consistency_after_m"] = joint.consistency_after_m;
    scene.calibration["witness_keypoints_before_px"] = joint.witnesses_before.keypoints_px;
    scene.calibration["witness_keypoints_after_px"] = joint.witnesses_after.keypoints_px;
    scene.calibration["witness_corners_before_px"] = joint.witnesses_before.corners_px;
    scene.calibration["witness_corners_after_px"] = joint.witnesses_after.corners_px;
    if (!joint.accepted && joint.num_pairs > 0)
      scene.warnings.push_back(say::reconstruction::RegistrationLeftOut());
  }

  [[nodiscard]] ViewSurfaceOptions ViewOptions(const std::stop_token& stop) const {
    return {.min_depth_m = static_cast<float>(sweep_.info.usable_depth.nearest_m),
            .max_depth_m = static_cast<float>(sweep_.info.usable_depth.farthest_m),
            .depth_noise = sweep_.info.depth_noise,
            .edge_px = ClassOf(sweep_.info.depth_sensor).edge_px,
            .stop = stop};
  }

  // Of a body only, see CheckedBreathing().
  [[nodiscard]] std::optional<Breathing> BreathingOf(const std::vector<ViewSurface>& surfaces,
                                                     const JointRegistrationResult& joint,
                                                     const TrackingMap& map, const Scene& scene,
                                                     const std::stop_token& stop) const {
    std::vector<double> times_s;
    for (const ViewSurface& surface : surfaces) times_s.push_back(surface.time_s);
    std::vector<SurfacePatch> patches = MeasurePatches(surfaces, scene.cloud, stop);
    const std::optional<Breathing> found = FindBreathing(patches, times_s);
    if (!found || !(found->amplitude_m > 0)) return found;
    Body body;  // Up is known in the reference marker's frame only.
    if (scene.frame == SceneFrame::kReferenceMarker) body = FindBody(scene.cloud);
    for (SurfacePatch& patch : patches)
      patch.may_move = body.support && body.Contains(patch.centre_m.cast<double>());
    const Breathing on_body = FindBreathing(patches, times_s).value_or(Breathing());
    if (!joint.accepted) return CheckedBreathing(*found, on_body, on_body);
    SweepSolution dense{.calibration = joint.calibration};
    SweepSolution sparse{.calibration = joint.sparse_calibration};
    const Pose T_scene_world = SceneFromWorld(sweep_.info, map);
    for (const ViewSurface& surface : surfaces)
      dense.T_scene_depth.push_back(surface.T_world_camera);
    for (std::size_t k = 0; k < map.keyframes.size(); ++k)
      if (!map.keyframes[k].is_bare)
        sparse.T_scene_depth.push_back(T_scene_world * joint.T_world_depth_sparse[k]);
    MovePatches(sweep_.info.intrinsics, dense, sparse, patches);
    return CheckedBreathing(*found, on_body, FindBreathing(patches, times_s).value_or(Breathing()));
  }

  // The scene's surface, breathing and height map.
  void MakeSurfaces(const JointRegistrationResult& joint, TrackingMap& map,
                    const std::stop_token& stop, const Report& report, Scene& scene) const {
    report(0.5, say::progress::Surface());
    double stage = Now();
    const std::vector<ViewSurface> surfaces = PrepareCorrectedViews(
        map, sweep_.info.intrinsics, joint, SceneFromWorld(sweep_.info, map), ViewOptions(stop));
    scene.cloud = MergeSurface(surfaces, {.with_colors = sweep_.options.keep_color, .stop = stop});
    if (scene.cloud.empty())
      throw DataError(WhyNoSurface(surfaces, sweep_.median_depths_m, sweep_.info.usable_depth));
    scene.timings_s["clouds"] = Now() - stage;

    stage = Now();
    // Of a sweep whose numbers are wrong, what rises and falls need not be a breath.
    if (scene.refusals.empty()) scene.breathing = BreathingOf(surfaces, joint, map, scene, stop);
    WarnOfBreathing(scene);
    scene.timings_s["breathing"] = Now() - stage;

    report(0.8, say::progress::HeightMap());
    stage = Now();
    if (scene.frame == SceneFrame::kReferenceMarker)
      KeepHeightMap(RobustHeightMap(surfaces, {.stop = stop}), scene);
    scene.timings_s["height_map"] = Now() - stage;
  }

  // The published chain: tracking with its own bundle adjustment, then Algorithm 1 on a few
  // keyframes, single-pixel corners, means of means. The stated calibration of the sensor is used
  // unchanged.
  [[nodiscard]] Scene ReconstructPaper(const std::vector<TrackedFrame>& frames, TrackingMap& map,
                                       const std::stop_token& stop, const Report& report) const {
    report(0.0, say::progress::Registration());
    const double start = Now();
    JointRegistrationOptions joint_options;
    joint_options.marker_length_m = sweep_.info.room_markers.length_m;
    joint_options.depth_noise = sweep_.info.depth_noise;
    joint_options.calibrate = false;
    joint_options.use_dense = false;
    const CalibrationModel stated =
        RegisterJointly(sweep_.info.intrinsics, joint_options, map, stop).calibration;
    std::map<std::string, double> timings_s = {{"bundle_adjustment", Now() - start}};
    const std::vector<Keyframe> keyframes = PaperKeyframes(map, stated);
    PaperOptions paper_options;
    paper_options.icp.num_iterations = sweep_.options.num_icp_iterations;
    paper_options.icp.seed = sweep_.options.seed;
    paper_options.room_markers = sweep_.info.room_markers;
    std::string running;
    double stage = Now();
    const PaperReconstruction paper = ReconstructAsPublished(
        keyframes, paper_options, stop,
        [&](std::string_view next) {
          if (!running.empty()) timings_s[running] = Now() - stage;
          running = next;
          stage = Now();
        },
        [&](double fraction) { report(0.1 + 0.6 * fraction, say::progress::GlobalIcp()); });
    const Pose T_scene_world =
        paper.T_marker_world.value_or(map.keyframes.front().T_world_color.inverse());
    Scene scene = MakeScene({.info = sweep_.info,
                             .preset = sweep_.options.preset,
                             .num_dropped = sweep_.num_dropped,
                             .frames = frames,
                             .map = map,
                             .calibration = stated,
                             .T_scene_world = T_scene_world});
    scene.timings_s = std::move(timings_s);
    scene.frame = paper.T_marker_world ? SceneFrame::kReferenceMarker : SceneFrame::kFirstKeyframe;
    scene.markers = paper.markers_in_world;
    for (auto& [id, marker] : scene.markers)
      for (Eigen::Vector3d& corner : marker.corners) corner = T_scene_world * corner;
    WarnOfFrame(sweep_.info, map, scene);
    scene.keyframes.clear();
    std::vector<DepthView> views;
    for (std::size_t j = 0; j < keyframes.size(); ++j) {
      DepthView view = keyframes[j].view;
      view.T_world_camera = T_scene_world * paper.T_refined_world[j] * view.T_world_camera;
      if (!sweep_.options.keep_color) view.color_rgb.release();
      scene.keyframes.push_back({keyframes[j].depth_time_s, view.T_world_camera});
      views.push_back(std::move(view));
    }
    const std::vector<ViewSurface> surfaces = PrepareViews(views, ViewOptions(stop));
    scene.cloud = MergeSurface(surfaces, {.with_colors = sweep_.options.keep_color, .stop = stop});
    if (scene.cloud.empty())
      throw DataError(WhyNoSurface(surfaces, sweep_.median_depths_m, sweep_.info.usable_depth));
    if (paper.height_map) KeepHeightMap(*paper.height_map, scene);
    return scene;
  }

  // Spread evenly over the sweep. Each section contributes the keyframe that sees the most markers,
  // because markers are measured from these few keyframes alone.
  static std::vector<Keyframe> PaperKeyframes(const TrackingMap& map,
                                              const CalibrationModel& stated) {
    std::vector<Keyframe> keyframes;
    const std::size_t step = (map.keyframes.size() + kMaxPaperKeyframes - 1) / kMaxPaperKeyframes;
    for (std::size_t first = 0; first < map.keyframes.size(); first += step) {
      const MapKeyframe* best = nullptr;
      for (std::size_t k = first; k < std::min(first + step, map.keyframes.size()); ++k) {
        const MapKeyframe& keyframe = map.keyframes[k];
        if (keyframe.is_bare) continue;
        if (best != nullptr && keyframe.data.markers.size() <= best->data.markers.size()) continue;
        if (cv::countNonZero(keyframe.data.view.depth_m) > 0) best = &keyframe;
      }
      if (best == nullptr) continue;
      keyframes.push_back(best->data);
      keyframes.back().view.T_world_camera = DepthPose(*best, stated);
    }
    return keyframes;
  }

  TrackedSweep sweep_;
  const std::stop_token& stop_;
  const std::function<void(double, const Message&)>& progress_;
};

}  // namespace

Scene SolveScene(TrackedSweep sweep, const std::stop_token& stop,
                 const std::function<void(double, const Message&)>& progress) {
  return SceneSolver(std::move(sweep), stop, progress).Solve();
}

}  // namespace plumb
