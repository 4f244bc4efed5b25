// SPDX-License-Identifier: Apache-2.0
#include "algo/comparison/comparison.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>
#include <numbers>
#include <stdexcept>

#include <fmt/format.h>
#include <tbb/parallel_invoke.h>

#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/statistics.hpp"
#include "algo/comparison/deviation.hpp"
#include "algo/comparison/planned_reference.hpp"
#include "algo/comparison/shared_sensor.hpp"
#include "algo/motion/body_motion.hpp"
#include "algo/motion/deformation.hpp"
#include "algo/motion/surface.hpp"
#include "words/acceptance.hpp"
#include "words/comparison.hpp"

namespace plumb {
namespace {

constexpr double kCloudReach_m = 0.004;  // disc radius of one point; cloud points are 3 mm apart
constexpr double kCloudSpacing_m = 0.003;
// fraction of the tolerance from which a direction is reported as weak
constexpr double kWeakFraction = 0.5;
// Distance from the plan's isocentre above which a stated one causes a warning.
constexpr double kSameIsocentre_m = 1 * kMillimetre;
// Distance of an isocentre from the middle of the region: a body is 2 m long, a couch 3 m.
constexpr double kUsualIsocentre_m = 1.0, kPossibleIsocentre_m = 3.0;

// The six numbers in the order of kNumberNames; absent where they are not reported.
std::array<std::optional<double>, 6> Values(const CouchNumbers& numbers) {
  return {numbers.vertical_mm, numbers.longitudinal_mm, numbers.lateral_mm,
          numbers.pitch_deg,   numbers.roll_deg,        numbers.yaw_deg};
}

// A CT may show a part of the body only, whose middle says nothing of where the rest is. But a
// patient is laid down roughly where the plan has him; Y is along the couch.
std::vector<Pose> StartsNearPlan() {
  std::vector<Pose> starts;
  for (const double along_m : {0.0, -0.12, 0.12})
    starts.emplace_back(Eigen::Translation3d(0, along_m, 0));
  return starts;
}

void CheckOptions(const CompareOptions& options) {
  const auto positive = [](double value, const char* name) {
    if (!(value > 0) || !std::isfinite(value))
      throw std::invalid_argument(
          fmt::format("comparison: {} must be positive, got {}", name, value));
  };
  CheckLimits(options.limits);
  positive(options.markers.moved_m, "moved-marker limit");
  positive(options.markers.moved_sigmas, "moved-marker sigmas");
  if (!options.region_polygon_m.empty() && options.region_polygon_m.size() < 3) {
    throw std::invalid_argument(fmt::format("comparison: a region needs at least 3 points, got {}",
                                            options.region_polygon_m.size()));
  }
  for (const Eigen::Vector2d& p : options.region_polygon_m) {
    if (!p.allFinite())
      throw std::invalid_argument("comparison: the region holds a value that is not finite");
  }
  const StatedSurface stated = options.surface.value_or(StatedSurface{});
  for (const double u95_m : {stated.clothing_u95_m, stated.ct_breathing_u95_m})
    if (!(u95_m >= 0) || !std::isfinite(u95_m))
      throw std::invalid_argument(fmt::format(
          "comparison: what is stated of the surface must be 0 or more, got {}", u95_m));
  if (options.isocentre_m && !options.isocentre_m->allFinite())
    throw std::invalid_argument("comparison: the isocentre is not finite");
  for (const std::optional<Pose>& T :
       {options.T_iec_reference, options.reference_room.value_or(CalibratedRoom{}).T_iec_reference})
    if (T && !IsFinite(*T))
      throw std::invalid_argument("comparison: the IEC transform is not finite");
}

// NaN where the scene states none: markers of other programs have the default.
double MeanMarkerSigma(const Scene& scene) {
  double sum_m = 0.0;
  int count = 0;
  for (const auto& [id, marker] : scene.markers) {
    if (marker.sigma_m == SceneMarker().sigma_m) continue;
    sum_m += marker.sigma_m;
    ++count;
  }
  return count > 0 ? sum_m / count : Evidence::kNotMeasured;
}

void CheckScenesMatch(const Scene& reference, const Scene& current) {
  if (reference.room_markers.dictionary != current.room_markers.dictionary) {
    throw DataError(say::comparison::OtherDictionary(reference.room_markers.dictionary,
                                                     current.room_markers.dictionary));
  }
  if (!(std::abs(reference.room_markers.length_m - current.room_markers.length_m) < 1e-6)) {
    throw DataError(say::comparison::OtherLength(reference.room_markers.length_m,
                                                 current.room_markers.length_m));
  }
}

// One comparison in progress. Compare() runs its steps in order.
class Comparer {
 public:
  Comparer(const Scene& reference, const Scene& current, const CompareOptions& options)
      : reference_(reference), current_(current), options_(options) {
    result_.preset = options.preset;
    result_.limits = options.limits;
    result_.marker_consensus = options.markers;
    result_.planning = reference.planning;
    if (result_.planning && options.surface) result_.planning->surface = *options.surface;
    result_.reference_profile = reference.sensor_profile;
    result_.current_profile = current.sensor_profile;
    evidence_.reference_lost_s = reference.longest_lost_s;
    evidence_.current_lost_s = current.longest_lost_s;
    if (reference.breathing) evidence_.reference_breathing_m = reference.breathing->amplitude_m;
    if (current.breathing) evidence_.current_breathing_m = current.breathing->amplitude_m;
    evidence_.region_is_drawn = !options.region_polygon_m.empty();
    evidence_.reference_markers_sigma_m = MeanMarkerSigma(reference);
    evidence_.current_markers_sigma_m = MeanMarkerSigma(current);
    TakeFindings(reference, say::acceptance::ScanReference());
    TakeFindings(current, say::acceptance::ScanCurrent());
    CheckSensors();
  }

  Comparison Run() {
    if (AlignAsNeeded()) {
      Segment();
      CheckStop(options_.stop);
      const bool moved = Move();
      CheckStop(options_.stop);
      // None of these needs what another one finds.
      if (moved) {
        tbb::parallel_invoke([&] { Heights(); }, [&] { Deform(); }, [&] { HeightsAfter(); });
      } else {
        Heights();
      }
      CheckStop(options_.stop);
      if (moved) Judge();
    }
    Decision decision = Decide(evidence_, options_.limits);
    result_.verdict = decision.verdict;
    result_.reasons = std::move(decision.reasons);
    result_.judgements = decision.numbers;
    if (planned_ && reference_.planning) ToMarkerFrame();
    Lap("total", start_s_);
    return std::move(result_);
  }

 private:
  [[nodiscard]] double Now() const { return options_.now_s ? options_.now_s() : 0.0; }
  void Lap(const char* name, double since_s) {
    if (!options_.now_s) return;
    const std::scoped_lock lock(timings_mutex_);
    result_.timings_s[name] = Now() - since_s;
  }
  bool Refuse(Message reason) {
    evidence_.failure = std::move(reason);
    return false;
  }

  // Warnings and refusals of either scan apply to the comparison as well.
  void TakeFindings(const Scene& scene, const Message& scan) {
    for (const Message& warning : scene.warnings)
      result_.warnings.push_back(say::comparison::ScanWarned(scan, warning));
    for (const Message& refusal : scene.refusals)
      evidence_.refusals.push_back(say::acceptance::ScanRefused(scan, refusal));
  }

  // What one class of sensors shows of skin, edges and distances, another shows differently.
  void CheckSensors() {
    if (!reference_.depth_sensor || !current_.depth_sensor ||
        *reference_.depth_sensor == *current_.depth_sensor)
      return;
    evidence_.refusals.push_back(say::comparison::OtherDepthSensor(
        std::string(Name(*reference_.depth_sensor)), std::string(Name(*current_.depth_sensor))));
  }

  bool AlignAsNeeded() {
    if (reference_.planning) return AlignPlanned();
    return options_.reference_room ? AlignRooms() : Align();
  }

  bool Align() {
    if (reference_.frame != SceneFrame::kReferenceMarker) {
      return Refuse(say::comparison::NoReferenceFrame());
    }
    if (!reference_.height_map) {
      return Refuse(say::comparison::NoHeightMap());
    }
    const double since_s = Now();
    const int needed = options_.limits.min_shared_markers;
    AlignmentOutcome outcome = AlignScenes(reference_.markers, current_.markers, options_.preset,
                                           options_.markers, needed);
    result_.warnings.insert(result_.warnings.begin(), outcome.warnings.begin(),
                            outcome.warnings.end());
    evidence_.markers = std::move(outcome.markers);
    if (!outcome.alignment) {
      const std::vector<Message> refusals = RefusalsOfMarkers(evidence_.markers, needed);
      return Refuse(refusals.empty() ? say::comparison::NoAlignment() : refusals.front());
    }
    result_.alignment = std::move(outcome.alignment);
    Lap("alignment", since_s);
    return true;
  }

  // Places a scan in its room, or says why not. The scan has a name where two are placed.
  std::optional<PlacedScan> Place(const Scene& scan, const CalibratedRoom& room,
                                  const std::optional<Message>& name = {}) {
    PlacedScan placed = PlaceInRoom(scan, room, options_.preset, options_.markers,
                                    options_.limits.min_shared_markers);
    std::vector<Message>& warnings = placed.warnings;
    if (name) {
      for (Message& warning : warnings) warning = say::comparison::ScanWarned(*name, warning);
    }
    result_.warnings.insert(result_.warnings.begin(), warnings.begin(), warnings.end());
    evidence_.markers = placed.markers;
    // The gates will see the markers of the scan that is placed last.
    if (name && placed.alignment) {
      const std::vector<Message> refusals =
          RefusalsOfMarkers(placed.markers, options_.limits.min_shared_markers);
      if (!refusals.empty()) {
        Refuse(say::acceptance::ScanRefused(*name, refusals.front()));
        return std::nullopt;
      }
    }
    if (placed.alignment) return placed;
    Refuse(name ? say::acceptance::ScanRefused(*name, placed.failure) : placed.failure);
    return std::nullopt;
  }

  // The room's calibration takes the place of shared markers. All work is in IEC axes.
  bool AlignPlanned() {
    if (!reference_.height_map) return Refuse(say::comparison::NoHeightMap());
    std::optional<PlacedScan> placed = Place(current_, RoomOfCurrent());
    if (!placed) return false;
    planned_ = PlannedUncertainty{.scans = {placed->uncertainty},
                                  .skin_u95_m = result_.planning->skin_u95_m,
                                  .slice_spacing_m = result_.planning->slice_spacing_m,
                                  .surface = result_.planning->surface};
    result_.alignment = std::move(placed->alignment);
    T_iec_reference_ = Pose::Identity();
    posture_ = reference_.planning->posture;
    isocentre_m_ = Eigen::Vector3d::Zero();
    if (options_.isocentre_m) {
      const double off_m = (*options_.T_iec_reference * *options_.isocentre_m).norm();
      if (off_m > kSameIsocentre_m)
        result_.warnings.push_back(say::comparison::IsocentreOfPlan(off_m / kMillimetre));
    }
    return true;
  }

  // Both rooms' calibrations take the place of shared markers. All work is in the frame of the
  // reference scan.
  bool AlignRooms() {
    if (!reference_.height_map) return Refuse(say::comparison::NoHeightMap());
    std::optional<PlacedScan> reference =
        Place(reference_, *options_.reference_room, say::acceptance::ScanReference());
    if (!reference) return false;
    std::optional<PlacedScan> current =
        Place(current_, RoomOfCurrent(), say::acceptance::ScanCurrent());
    if (!current) return false;
    const Pose T_reference_iec = reference->alignment->T_reference_current.inverse();
    for (PlacedScan* scan : {&*reference, &*current})
      scan->uncertainty.origin_m = T_reference_iec * scan->uncertainty.origin_m;
    planned_ = PlannedUncertainty{.scans = {reference->uncertainty, current->uncertainty},
                                  .isocentre_m = T_reference_iec.translation()};
    result_.alignment = AlignAcrossRooms(*reference->alignment, *current->alignment);
    reference_markers_ = reference->alignment->markers_used;
    T_iec_reference_ = reference->alignment->T_reference_current;
    return true;
  }

  [[nodiscard]] CalibratedRoom RoomOfCurrent() const {
    return {.T_iec_reference = options_.T_iec_reference,
            .u95_m = options_.iec_u95_m,
            .u95_rad = options_.iec_u95_rad,
            .calibration_u95_m = options_.calibration_u95_m,
            .calibration_u95_rad = options_.calibration_u95_rad,
            .markers = options_.room_markers,
            .why_not = options_.why_no_room};
  }

  // Where shared markers would have stated the motion.
  void ToMarkerFrame() {
    if (!result_.motion) return;
    BodyMotion& motion = *result_.motion;
    const Pose& T_iec_current = result_.alignment->T_reference_current;
    const Pose T_current_iec = T_iec_current.inverse();
    motion.T = T_current_iec * motion.T * T_iec_current;
    motion.centroid_m = T_current_iec * motion.centroid_m;
    MotionUncertainty& parts = motion.uncertainty;
    for (Matrix6d* part : {&parts.surface, &parts.markers, &parts.distortion, &parts.scale,
                           &parts.frame, &parts.sensor, &parts.breathing, &parts.room, &parts.skin,
                           &parts.slices, &parts.clothing, &parts.ct_breathing})
      *part = CovarianceTurned(*part, T_current_iec.linear());
    motion.covariance = parts.Total();
    if (result_.correction)
      result_.correction->isocentre_m = T_current_iec * result_.correction->isocentre_m;
  }

  // From the current scene to the reference frame, including the correction of its scale in the
  // marker plane.
  [[nodiscard]] Eigen::Affine3d StretchedAlignment() const {
    const Alignment& alignment = *result_.alignment;
    return Eigen::Translation3d(alignment.centre_m) * Eigen::Affine3d(alignment.stretch) *
           Eigen::Translation3d(-alignment.centre_m) * T_sensor_correction_ *
           alignment.T_reference_current;
  }

  void Segment() {
    const double since_s = Now();
    tbb::parallel_invoke(
        [&] {
          reference_cloud_ = SceneCloud(reference_, Eigen::Affine3d::Identity());
          CheckStop(options_.stop);
          reference_body_ = BodyOfScene(reference_, reference_cloud_);
        },
        [&] {
          current_cloud_ = SceneCloud(current_, StretchedAlignment());
          CheckStop(options_.stop);
          current_body_ = FindBody(current_cloud_);
        });
    if (!reference_body_.support)
      result_.warnings.push_back(say::comparison::ReferenceWithoutSupport());
    if (!current_body_.support)
      result_.warnings.push_back(say::comparison::CurrentWithoutSupport());
    evidence_.reference_has_support = reference_body_.support.has_value();
    result_.region_mask =
        RegionMask(*reference_.height_map, reference_body_, options_.region_polygon_m);
    Lap("region", since_s);
  }

  void Heights() {
    const double since_s = Now();
    result_.current_height = CurrentHeight(Pose::Identity());
    CheckStop(options_.stop);
    result_.deviation = HeightDifference(*result_.current_height, *reference_.height_map);
    CheckStop(options_.stop);
    result_.distance = SignedDistance(*result_.current_height, *reference_.height_map);
    Lap("deviation", since_s);
  }

  // The current surface on the reference grid, moved by T after the alignment.
  [[nodiscard]] HeightMap CurrentHeight(const Pose& T) const {
    const GridShape& grid = reference_.height_map->grid;
    if (current_.height_map)
      return ResampledHeightMap(*current_.height_map, T * StretchedAlignment(), grid);
    return HeightMapOfCloud(TransformedCloud(T, current_cloud_), kCloudReach_m, grid);
  }

  bool Move() {
    const double since_s = Now();
    const std::optional<Eigen::Vector3d> centroid =
        RegionCentroid(*reference_.height_map, result_.region_mask);
    if (!centroid) {
      return Refuse(options_.region_polygon_m.empty() ? say::comparison::NoBody()
                                                      : say::comparison::RegionEmpty());
    }
    const GridShape& grid = reference_.height_map->grid;
    BodyMotionInput input{
        reference_cloud_, reference_body_, current_cloud_, current_body_, nullptr, *centroid, {},
        options_.stop};
    if (reference_.planning) input.starts = StartsNearPlan();
    if (!options_.region_polygon_m.empty()) {
      input.in_region = [&](const Eigen::Vector3d& p) {
        const auto cell = grid.cell(p.x(), p.y());
        return cell && result_.region_mask[*cell] != 0;
      };
    }
    const std::optional<SurfaceMotion> surface = EstimateBodyMotion(input);
    if (reference_.planning && FitsOtherEnd(input, surface ? surface->inlier_fraction : 0.0))
      return Refuse(say::comparison::PlanOtherEnd(std::string(Name(posture_))));
    if (!surface) {
      const double rms_m = result_.alignment->rms_m;
      return Refuse(MarkersDisagree(rms_m)
                        ? say::comparison::NoMotionOrDistorted(rms_m / kMillimetre)
                        : say::comparison::NoMotion());
    }

    BodyMotion motion;
    motion.T = surface->T;
    motion.centroid_m = *centroid;
    motion.inlier_fraction = surface->inlier_fraction;
    const std::optional<Matrix6d> sensor = TakeSensor(motion);
    motion.uncertainty = Uncertainty(
        {.alignment = *result_.alignment,
         .surface = surface->covariance,
         .T_motion = motion.T,
         .centroid_m = *centroid,
         .sensor = sensor,
         .classes = Classes(),
         .scale_doubt = std::max(reference_.scale_doubt, current_.scale_doubt),
         .breathing_m = std::hypot(evidence_.reference_breathing_m, evidence_.current_breathing_m),
         .planned = planned_});
    motion.covariance = motion.uncertainty.Total();
    evidence_.markers_rms_m = result_.alignment->rms_m;
    evidence_.shift_doubt = LargestCause(motion.uncertainty, *result_.alignment, false);
    evidence_.turn_doubt = LargestCause(motion.uncertainty, *result_.alignment, true);
    result_.motion = motion;
    Lap("motion", since_s);
    return true;
  }

  // Whether the contour fits the body after half a turn about the vertical, and not without: head
  // and feet are exchanged, in the plan or on the couch.
  bool FitsOtherEnd(BodyMotionInput input, double fraction) const {
    constexpr double kFits = 0.8;  // Right pairs: 0.87 to 0.90 (20 of four positions, 320x240).
    if (fraction >= kFits) return false;
    const Pose turn(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitZ()));
    for (Pose& start : input.starts) start = start * turn;
    const std::optional<SurfaceMotion> turned = EstimateBodyMotion(input);
    return turned && turned->inlier_fraction >= kFits;
  }

  [[nodiscard]] std::vector<DepthSensor> Classes() const {
    std::vector<DepthSensor> classes;
    for (const Scene* scene : {&reference_, &current_})
      if (scene->depth_sensor) classes.push_back(*scene->depth_sensor);
    return classes;
  }

  // What the sensors' calibrations leave uncertain of the motion. Two sweeps are joined by what
  // they share; of a planning CT, the skin is taken, too.
  std::optional<Matrix6d> TakeSensor(BodyMotion& motion) {
    const auto on_region = [&](const Eigen::Vector3d& p) { return IsOnRegion(p); };
    const SharedSensorInput input{.reference = reference_,
                                  .current = current_,
                                  .alignment = *result_.alignment,
                                  .T_motion = motion.T,
                                  .centroid_m = motion.centroid_m,
                                  .in_region = on_region};
    if (options_.reference_room) return SensorsApart(input, reference_markers_);
    if (planned_) {
      planned_->feigned =
          FeignedBy(reference_cloud_, on_region, motion.T, motion.T * motion.centroid_m);
      return SensorAlone(input);
    }
    const std::optional<SharedSensor> sensor = JoinSensors(input);
    if (!sensor) return std::nullopt;
    JoinSensor(*sensor, motion);
    return sensor->covariance;
  }

  // Whether a point lies in the region and near the reference surface there.
  [[nodiscard]] bool IsOnRegion(const Eigen::Vector3d& p) const {
    constexpr double kNear_m = 0.1;
    const HeightMap& map = *reference_.height_map;
    const auto cell = map.grid.cell(p.x(), p.y());
    return cell && result_.region_mask[*cell] != 0 && std::isfinite(map.z[*cell]) &&
           std::abs(map.z[*cell] - p.z()) < kNear_m;
  }

  // Moves the current scan's surface in the reference frame, and the motion with it. The alignment
  // remains the fit of the markers, which its residuals and covariance describe.
  void JoinSensor(const SharedSensor& sensor, BodyMotion& motion) {
    const Eigen::Vector3d moved = motion.T * motion.centroid_m;
    const Pose by = PoseAbout(moved, sensor.correction);
    motion.T = by * motion.T;
    T_sensor_correction_ = by;
    current_cloud_ = TransformedCloud(by, current_cloud_);
  }

  // Coverage and remaining deviation, with the body moved back.
  void HeightsAfter() {
    const double since_s = Now();
    const Pose& T_motion = result_.motion->T;
    result_.region = CoverageOf(*reference_.height_map, result_.region_mask, current_cloud_,
                                kCloudSpacing_m, T_motion);
    CheckStop(options_.stop);
    const HeightMap corrected = CurrentHeight(T_motion.inverse());
    result_.deviation_after = HeightDifference(corrected, *reference_.height_map);
    Residuals(corrected);
    Lap("deviation_after", since_s);
  }

  void Judge() {
    const double since_s = Now();
    const BodyMotion& motion = *result_.motion;
    result_.body_parts =
        DescribeBody({.reference = *reference_.height_map,
                      .deviation_after = *result_.deviation_after,
                      .region_mask = result_.region_mask,
                      .body_mask = RegionMask(*reference_.height_map, reference_body_, {}),
                      .T_motion = motion.T,
                      .T_iec_reference = T_iec_reference_,
                      .marker_kind = options_.marker_kind,
                      .posture = posture_,
                      .deformation = result_.deformation ? &*result_.deformation : nullptr,
                      .hole_centre_m = result_.region->hole_centre_m});
    JudgeIsocentre(motion.centroid_m);
    if (result_.body_parts->head_at_other_end)
      result_.warnings.push_back(say::comparison::HeadAtOtherEnd());
    const std::optional<PatientPosture> posture =
        result_.body_parts->by_posture ? std::optional(posture_) : std::nullopt;
    result_.correction = CorrectionOf(motion.T, motion.covariance, motion.centroid_m,
                                      isocentre_m_.value_or(motion.centroid_m), T_iec_reference_,
                                      options_.marker_kind, posture, result_.body_parts->patient);
    evidence_.coverage = result_.region->coverage;
    evidence_.largest_hole_m = result_.region->largest_hole_m;
    evidence_.hole_place = result_.body_parts->hole_place;
    TakeNumbers();
    if (options_.marker_kind == MarkerKind::kCouch) {
      result_.warnings.push_back(say::comparison::CouchMarkers());
    }
    Lap("judge", since_s);
  }

  // An error of rotation moves the isocentre in proportion to its distance from the body.
  void JudgeIsocentre(const Eigen::Vector3d& centroid_m) {
    if (!isocentre_m_) return;
    const double away_m = (*isocentre_m_ - centroid_m).norm();
    if (away_m <= kUsualIsocentre_m) return;
    const double size_m = isocentre_m_->norm();
    Message unit = size_m > 100 * kUsualIsocentre_m  ? say::comparison::PerhapsMillimetres()
                   : size_m > 10 * kUsualIsocentre_m ? say::comparison::PerhapsCentimetres()
                                                     : say::comparison::PerhapsOtherPlace();
    Message far = say::comparison::IsocentreFar(away_m, std::move(unit));
    if (away_m > kPossibleIsocentre_m) {
      evidence_.refusals.push_back(std::move(far));
    } else {
      result_.warnings.push_back(std::move(far));
    }
  }

  void Deform() {
    const double since_s = Now();
    result_.deformation = EstimateDeformation({.reference_cloud = reference_cloud_,
                                               .reference_body = reference_body_,
                                               .current_cloud = current_cloud_,
                                               .current_body = current_body_,
                                               .T_motion = result_.motion->T,
                                               .stop = options_.stop});
    Lap("deformation", since_s);
  }

  void TakeNumbers() {
    const auto value = Values(result_.correction->value);
    const auto u95 = Values(result_.correction->u95);
    for (std::size_t i = 0; i < value.size(); ++i) {
      if (!value[i] || !u95[i]) continue;
      evidence_.numbers[i] = MeasuredNumber{*value[i], *u95[i], result_.correction->words[i]};
      if (*u95[i] > kWeakFraction * ToleranceOf(options_.limits, i)) {
        result_.motion->weak_directions.push_back({kNumberNames[i], *u95[i], UnitOf(i)});
      }
    }
  }

  void Residuals(const HeightMap& corrected) {
    const HeightMap distance =
        SignedDistance(corrected, *reference_.height_map, result_.region_mask);
    std::vector<float> magnitudes;
    for (std::size_t i = 0; i < distance.z.size(); ++i) {
      // Whatever moved with the room and not with the body does not belong to the correction.
      if (result_.region_mask[i] == 0)
        result_.deviation_after->z[i] = std::numeric_limits<float>::quiet_NaN();
      if (std::isfinite(distance.z[i])) magnitudes.push_back(std::abs(distance.z[i]));
    }
    if (magnitudes.empty()) return;
    result_.motion->residual_median_m = TakeQuantile(magnitudes, 0.5);
    result_.motion->residual_p95_m = TakeQuantile(magnitudes, 0.95);
    evidence_.residual_p95_m = result_.motion->residual_p95_m;
  }

  const Scene& reference_;
  const Scene& current_;
  const CompareOptions& options_;
  // As the options state them, or the plan.
  std::optional<Pose> T_iec_reference_ = options_.T_iec_reference;
  std::optional<Eigen::Vector3d> isocentre_m_ = options_.isocentre_m;
  PatientPosture posture_ = options_.posture;
  std::optional<PlannedUncertainty> planned_;  // Where rooms join the scans.
  std::vector<int> reference_markers_;         // That place the reference in its own room.
  double start_s_ = Now();
  Comparison result_;
  std::mutex timings_mutex_;
  Evidence evidence_;
  Pose T_sensor_correction_ =
      Pose::Identity();         // Applied to the current surface after the alignment.
  PointCloud reference_cloud_;  // reference frame
  PointCloud current_cloud_;    // reference frame, after alignment
  Body reference_body_;
  Body current_body_;
};

}  // namespace

Comparison Compare(const Scene& reference, const Scene& current, const CompareOptions& options) {
  CheckOptions(options);
  if (!reference.planning && !options.reference_room) CheckScenesMatch(reference, current);
  return Comparer(reference, current, options).Run();
}

}  // namespace plumb
