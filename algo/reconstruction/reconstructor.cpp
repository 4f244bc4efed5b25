#include "algo/reconstruction/reconstructor.hpp"

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
#include "algo/markers/sweep_tone.hpp"
#include "algo/reconstruction/breathing.hpp"
#include "algo/reconstruction/corrected_views.hpp"
#include "algo/reconstruction/height_maps.hpp"
#include "algo/reconstruction/joint_registration.hpp"
#include "algo/reconstruction/paper_reconstruction.hpp"
#include "algo/reconstruction/scene_assembly.hpp"
#include "algo/reconstruction/sensor_sensitivity.hpp"
#include "algo/reconstruction/surface_cloud.hpp"
#include "algo/reconstruction/surface_mesh.hpp"
#include "algo/reconstruction/trajectory.hpp"
#include "algo/reconstruction/view_surface.hpp"
#include "algo/tracking/map_budget.hpp"
#include "algo/tracking/tracker.hpp"
#include "algo/types/marker_dictionary.hpp"

namespace plumb {
namespace {

constexpr std::size_t kMaxPaperKeyframes = 20;  // The paper had about 15 a sweep.
// Errors of marker edges once the tone curve and the edge shift have been measured: what remains is
// the variation with blur and exposure.
constexpr double kMeasuredEdgeSigma_px = 0.01;

TrackerOptions TrackingOptions(const StreamInfo& info, const ReconstructorOptions& options) {
  TrackerOptions tracking;
  tracking.use_markers = options.use_markers;
  tracking.use_keypoints = options.use_keypoints;
  tracking.keep_color = options.keep_color;
  // Surfaces take their colours at working resolution only.
  if (options.preset == Preset::kBest)
    tracking.color_block = info.intrinsics.width / WorkingIntrinsics(info.intrinsics).width;
  tracking.keyframe_distance *= options.keyframe_spacing;
  tracking.keyframe_angle_rad *= options.keyframe_spacing;
  tracking.max_images = options.max_images;
  tracking.min_tracked_fraction =
      1.0 - options.keyframe_spacing * (1.0 - tracking.min_tracked_fraction);
  return tracking;
}

// States why the scene contains no points. The depth is the median over the frames' medians.
std::string WhyNoSurface(std::span<const ViewSurface> surfaces,
                         std::vector<double> median_depths_m) {
  const double median_depth_m = TakeMedian(median_depths_m);
  const ViewSurfaceOptions range;
  const bool measured =
      std::any_of(surfaces.begin(), surfaces.end(), [](const ViewSurface& surface) {
        return std::any_of(surface.pixels.begin(), surface.pixels.end(),
                           [](const ViewSurface::Pixel& pixel) { return pixel.weight > 0; });
      });
  if (measured)
    return fmt::format(
        "no surface was seen alike by two of {} keyframes (depth {:.2f} m in the median): sweep "
        "slowly over a scene that stands still",
        surfaces.size(), median_depth_m);
  return fmt::format(
      "no usable surface in {} keyframes: depth is {:.2f} m in the median, expected from {:.1f} to "
      "{:.1f} m; check depth_scale in "
      "camera.yaml and "
      "the distance to the scene",
      surfaces.size(), median_depth_m, range.min_depth_m, range.max_depth_m);
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

}  // namespace

struct Reconstructor::Impl {
  StreamInfo info;
  ReconstructorOptions options;
  Tracker tracker;
  std::int64_t dropped = 0;
  std::vector<double> median_depths_m;  // One per frame that has valid depth.
  std::vector<double> tracking_times_s;

  Impl(const StreamInfo& stream, const ReconstructorOptions& reconstructor_options)
      : info(stream),
        options(reconstructor_options),
        tracker(stream, TrackingOptions(stream, reconstructor_options)) {}

  [[nodiscard]] double Now() const { return options.now_s ? options.now_s() : 0.0; }

  TrackingReport AddFrame(const Frame& frame, bool fewer_keypoints) {
    if (frame.color_rgb.cols != info.intrinsics.width ||
        frame.color_rgb.rows != info.intrinsics.height ||
        frame.depth_m.size() != frame.color_rgb.size())
      throw DataError(fmt::format(
          "frame {}: images are {}x{} (colour) and {}x{} (depth), the calibration is for {}x{}",
          frame.index, frame.color_rgb.cols, frame.color_rgb.rows, frame.depth_m.cols,
          frame.depth_m.rows, info.intrinsics.width, info.intrinsics.height));
    TrackingReport report;
    DepthStatistics(frame.depth_m, report);
    const double start = Now();
    const TrackedFrame tracked = tracker.Track(frame, fewer_keypoints);
    tracking_times_s.push_back(Now() - start);
    report.tracked = tracked.tracked;
    report.is_keyframe = tracked.keyframe.has_value();
    report.num_keypoints = tracked.num_keypoints;
    report.num_markers = tracked.num_markers;
    if (tracked.tracked) {
      const double dt = tracked.depth_time_s - tracked.color_time_s;
      report.T_world_camera = PoseAfter(tracker.T_world_color(tracked), tracked.velocity_per_s, dt);
    }
    if (HasReferenceMarker(info, tracker.map()))
      report.T_scene_world = SceneFromWorld(info, tracker.map());
    return report;
  }

  // Every eighth pixel in each direction is enough for guidance.
  void DepthStatistics(const cv::Mat& depth_m, TrackingReport& report) {
    std::vector<float> z;
    int total = 0;
    for (int r = 4; r < depth_m.rows; r += 8) {
      for (int c = 4; c < depth_m.cols; c += 8) {
        ++total;
        if (const float value = depth_m.at<float>(r, c); value > 0) z.push_back(value);
      }
    }
    report.valid_depth = total > 0 ? static_cast<double>(z.size()) / total : 0.0;
    if (z.empty()) return;
    report.median_depth_m = TakeMedian(z);
    median_depths_m.push_back(report.median_depth_m);
  }

  void CheckInput(const std::vector<TrackedFrame>& frames) const {
    if (frames.size() < 2)
      throw DataError(fmt::format(
          "the recording has {} usable frame(s), a scene needs at least 2: record a sweep",
          frames.size()));
    if (median_depths_m.empty())
      throw DataError(
          fmt::format("all {} depth images are empty (0 everywhere): check the sensor's depth "
                      "stream and depth_scale",
                      frames.size()));
  }

  Scene Finish(const std::stop_token& stop,
               const std::function<void(double, std::string_view)>& progress) {
    const double start = Now();
    const auto report = [&](double fraction, std::string_view what) {
      CheckStop(stop);
      if (progress) progress(fraction, what);
    };
    std::vector<TrackedFrame> frames = tracker.frames();
    CheckInput(frames);
    TrackingMap map = tracker.TakeMap();
    if (map.keyframes.empty())
      throw DataError(
          fmt::format("none of {} frames shows a marker or a surface: check that the sensor looks "
                      "at the scene from 0.5 to 1.5 m",
                      frames.size()));
    BoundKeyframes(options.max_keyframes, ColorPoses(frames, map), frames, map);
    RefreshVelocities(frames, map);

    Scene scene;
    if (options.preset == Preset::kPaper) {
      ReconstructPaper(frames, map, scene, stop, report);
    } else {
      ReconstructBest(frames, map, scene, stop, report);
    }
    report(0.9, "mesh");
    double stage = Now();
    constexpr int kDecimation = 2;
    if (scene.height_map)
      scene.mesh = MeshOfHeightMap(*scene.height_map,
                                   ColorsFromCloud(*scene.height_map, scene.cloud, kDecimation),
                                   {.decimation = kDecimation});
    scene.timings_s["mesh"] = Now() - stage;
    if (!tracking_times_s.empty())
      scene.timings_s["tracking_per_frame_median"] = TakeMedian(tracking_times_s);
    scene.timings_s["after_last_frame"] = Now() - start;
    report(1.0, "done");
    return scene;
  }

  using Report = std::function<void(double, std::string_view)>;

  // Estimates the camera's tone curve and measures the keyframes' markers again with it; tracking
  // assumed the sRGB curve.
  [[nodiscard]] std::optional<SweepTone> RefineMarkers(TrackingMap& map,
                                                       const std::stop_token& stop) const {
    if (!options.use_markers) return std::nullopt;
    const MarkerDictionary dictionary = MarkerDictionary::ByName(info.marker_dictionary);
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

  void ReconstructBest(std::vector<TrackedFrame>& frames, TrackingMap& map, Scene& scene,
                       const std::stop_token& stop, const Report& report) const {
    report(0.0, "markers");
    double stage = Now();
    const std::optional<SweepTone> tone =
        options.use_tone_curve ? RefineMarkers(map, stop) : std::nullopt;
    const double tone_s = Now() - stage;
    // The joint solve needs as much memory as the images, so what it does not use is released
    // first.
    for (MapKeyframe& keyframe : map.keyframes) {
      keyframe.gray.release();
      keyframe.descriptors.release();
    }
    report(0.05, "registration");
    stage = Now();
    JointRegistrationOptions joint_options;
    joint_options.marker_length_m = info.marker_length_m;
    joint_options.depth_noise = info.depth_noise;
    joint_options.use_depth_field = options.use_depth_field;
    joint_options.use_dense = options.use_dense_depth;
    joint_options.use_row_motion = options.use_row_motion;
    joint_options.refresh_velocities = [&frames](TrackingMap& moved) {
      RefreshVelocities(frames, moved);
    };
    const double edge_sigma_px = EdgeSigma(tone);
    joint_options.prior = options.profile
                              ? PriorOfNextSweep(*options.profile, info.intrinsics, edge_sigma_px)
                              : PriorOfAnyUnit(edge_sigma_px);
    const JointRegistrationResult joint =
        RegisterJointly(info.intrinsics, joint_options, map, stop);
    const double solved = Now();
    if (options.on_learned && joint.accepted)
      options.on_learned(Learn(options.profile.value_or(ProfileOfAnyUnit(info.intrinsics)),
                               joint_options.prior, joint.evidence));
    scene = MakeScene(info, options.preset, dropped, frames, map, joint.calibration,
                      joint.marker_sigmas_m, SceneFromWorld(info, map));
    WarnOfFrame(info, map, scene);
    if (scene.frame == SceneFrame::kReferenceMarker && !joint.posterior.empty()) {
      scene.sensitivity = SensitivityOf(info.intrinsics, joint.calibration, joint.posterior, map,
                                        *info.reference_marker);
      scene.sensitivity->stated_for_this_unit = !info.intrinsics_assumed;
      scene.sensitivity->serial = options.sensor_serial;
    }
    if (options.profile)
      scene.sensor_profile =
          fmt::format("{}, {} sweep{}", options.profile->name, options.profile->num_sweeps,
                      options.profile->num_sweeps == 1 ? "" : "s");
    for (const auto& [name, value] : joint.calibration.Named()) scene.calibration[name] = value;
    StateSigmas(joint.evidence.information, joint_options.prior.information, scene);
    WarnOfScale(scene.calibration.at("depth_scale"), scene);
    if (tone) {
      scene.calibration["tone_gamma"] = tone->gamma;
      scene.calibration["marker_edge_shift_px"] = tone->edge_shift_px;
      scene.calibration["marker_edge_shift_sigma_px"] = tone->sigma_edge_shift_px;
      scene.calibration["tone_gamma_sigma"] = tone->sigma_gamma;
    }
    scene.timings_s["tone_curve"] = tone_s;
    scene.calibration["consistency_before_m"] = joint.consistency_before_m;
    scene.calibration["consistency_after_m"] = joint.consistency_after_m;
    scene.calibration["witness_keypoints_before_px"] = joint.witnesses_before.keypoints_px;
    scene.calibration["witness_keypoints_after_px"] = joint.witnesses_after.keypoints_px;
    scene.calibration["witness_corners_before_px"] = joint.witnesses_before.corners_px;
    scene.calibration["witness_corners_after_px"] = joint.witnesses_after.corners_px;
    if (!joint.accepted && joint.num_pairs > 0)
      scene.warnings.push_back(
          "the dense registration did not make the views agree better and was left out");
    scene.timings_s["global_registration"] = solved - stage;
    // The joint solve has used the markers; they now place the keyframes in the scene's frame.
    scene.timings_s["markers"] = Now() - solved;

    report(0.5, "surface");
    stage = Now();
    ViewSurfaceOptions view_options;
    view_options.depth_noise = info.depth_noise;
    view_options.stop = stop;
    const std::vector<ViewSurface> surfaces = PrepareCorrectedViews(
        map, info.intrinsics, joint.calibration, SceneFromWorld(info, map), view_options);
    scene.cloud = MergeSurface(surfaces, {.with_colors = options.keep_color, .stop = stop});
    if (scene.cloud.empty()) throw DataError(WhyNoSurface(surfaces, median_depths_m));
    scene.timings_s["clouds"] = Now() - stage;

    stage = Now();
    std::vector<double> times_s;
    for (const ViewSurface& surface : surfaces) times_s.push_back(surface.time_s);
    scene.breathing = FindBreathing(MeasurePatches(surfaces, scene.cloud, stop), times_s);
    WarnOfBreathing(scene);
    scene.timings_s["breathing"] = Now() - stage;

    report(0.8, "height map");
    stage = Now();
    if (scene.frame == SceneFrame::kReferenceMarker)
      KeepHeightMap(RobustHeightMap(surfaces, {.stop = stop}), scene);
    scene.timings_s["height_map"] = Now() - stage;
  }

  // The published chain: tracking with its own bundle adjustment, then Algorithm 1 on a few
  // keyframes, single-pixel corners, means of means. The stated calibration of the sensor is used
  // unchanged.
  void ReconstructPaper(const std::vector<TrackedFrame>& frames, TrackingMap& map, Scene& scene,
                        const std::stop_token& stop, const Report& report) const {
    report(0.0, "registration");
    const double start = Now();
    JointRegistrationOptions joint_options;
    joint_options.marker_length_m = info.marker_length_m;
    joint_options.depth_noise = info.depth_noise;
    joint_options.calibrate = false;
    joint_options.use_dense = false;
    const CalibrationModel stated =
        RegisterJointly(info.intrinsics, joint_options, map, stop).calibration;
    scene.timings_s["bundle_adjustment"] = Now() - start;
    const std::vector<Keyframe> keyframes = PaperKeyframes(map, stated);
    PaperOptions paper_options;
    paper_options.icp.num_iterations = options.num_icp_iterations;
    paper_options.icp.seed = options.seed;
    paper_options.marker_length_m = info.marker_length_m;
    paper_options.reference_marker = info.reference_marker;
    std::string running;
    double stage = Now();
    std::map<std::string, double> timings;
    const PaperReconstruction paper = ReconstructAsPublished(
        keyframes, paper_options, stop,
        [&](std::string_view next) {
          if (!running.empty()) timings[running] = Now() - stage;
          running = next;
          stage = Now();
        },
        [&](double fraction) { report(0.1 + 0.6 * fraction, "global ICP"); });
    const Pose T_scene_world =
        paper.T_marker_world.value_or(map.keyframes.front().T_world_color.inverse());
    timings.merge(scene.timings_s);
    scene = MakeScene(info, options.preset, dropped, frames, map, stated, {}, T_scene_world);
    scene.timings_s = timings;
    scene.frame = paper.T_marker_world ? SceneFrame::kReferenceMarker : SceneFrame::kFirstKeyframe;
    scene.markers = paper.markers_in_world;
    for (auto& [id, marker] : scene.markers)
      for (Eigen::Vector3d& corner : marker.corners) corner = T_scene_world * corner;
    WarnOfFrame(info, map, scene);
    scene.keyframes.clear();
    std::vector<DepthView> views;
    for (std::size_t j = 0; j < keyframes.size(); ++j) {
      DepthView view = keyframes[j].view;
      view.T_world_camera = T_scene_world * paper.T_refined_world[j] * view.T_world_camera;
      if (!options.keep_color) view.color_rgb.release();
      scene.keyframes.push_back({keyframes[j].depth_time_s, view.T_world_camera});
      views.push_back(std::move(view));
    }
    const std::vector<ViewSurface> surfaces =
        PrepareViews(views, {.depth_noise = info.depth_noise, .stop = stop});
    scene.cloud = MergeSurface(surfaces, {.with_colors = options.keep_color, .stop = stop});
    if (scene.cloud.empty()) throw DataError(WhyNoSurface(surfaces, median_depths_m));
    if (paper.height_map) KeepHeightMap(*paper.height_map, scene);
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
};

Reconstructor::Reconstructor(const StreamInfo& info, const ReconstructorOptions& options)
    : impl_(std::make_unique<Impl>(info, options)) {}
Reconstructor::~Reconstructor() = default;
TrackingReport Reconstructor::AddFrame(const Frame& frame, bool fewer_keypoints) {
  return impl_->AddFrame(frame, fewer_keypoints);
}
void Reconstructor::CountDropped(int num_frames) { impl_->dropped += num_frames; }
Scene Reconstructor::Finish(const std::stop_token& stop,
                            const std::function<void(double, std::string_view)>& progress) {
  return impl_->Finish(stop, progress);
}

}  // namespace plumb
