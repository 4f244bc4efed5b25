#include "algo/comparison/comparison.hpp"

#include <array>
#include <cmath>
#include <mutex>
#include <stdexcept>

#include <fmt/format.h>
#include <tbb/parallel_invoke.h>

#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/statistics.hpp"
#include "algo/comparison/body_motion.hpp"
#include "algo/comparison/deformation.hpp"
#include "algo/comparison/deviation.hpp"
#include "algo/comparison/shared_sensor.hpp"
#include "algo/comparison/surface.hpp"

namespace plumb {
namespace {

constexpr double kCloudReach_m = 0.004;  // disc radius of one point; cloud points are 3 mm apart
constexpr double kCloudSpacing_m = 0.003;
// fraction of the tolerance from which a direction is reported as weak
constexpr double kWeakFraction = 0.5;

// The six numbers in the order of kNumberNames; absent where they are not reported.
std::array<std::optional<double>, 6> Values(const CouchNumbers& numbers) {
  return {numbers.vertical_mm, numbers.longitudinal_mm, numbers.lateral_mm,
          numbers.pitch_deg,   numbers.roll_deg,        numbers.yaw_deg};
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
  if (options.isocentre_m && !options.isocentre_m->allFinite())
    throw std::invalid_argument("comparison: the isocentre is not finite");
  if (options.T_iec_reference && !IsFinite(*options.T_iec_reference))
    throw std::invalid_argument("comparison: the IEC transform is not finite");
}

void CheckScenesMatch(const Scene& reference, const Scene& current) {
  if (reference.marker_dictionary != current.marker_dictionary) {
    throw DataError(
        fmt::format("cannot compare the scenes: the reference was made with marker dictionary {}, "
                    "the current one with {}; scan both "
                    "with the same markers",
                    reference.marker_dictionary, current.marker_dictionary));
  }
  if (!(std::abs(reference.marker_length_m - current.marker_length_m) < 1e-6)) {
    throw DataError(
        fmt::format("cannot compare the scenes: the reference was made with markers of {} m, the "
                    "current one with {} m; scan both "
                    "with the same markers",
                    reference.marker_length_m, current.marker_length_m));
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
    result_.reference_profile = reference.sensor_profile;
    result_.current_profile = current.sensor_profile;
    evidence_.reference_lost_s = reference.longest_lost_s;
    evidence_.current_lost_s = current.longest_lost_s;
    if (reference.breathing) evidence_.reference_breathing_m = reference.breathing->amplitude_m;
    if (current.breathing) evidence_.current_breathing_m = current.breathing->amplitude_m;
    evidence_.region_is_drawn = !options.region_polygon_m.empty();
  }

  Comparison Run() {
    if (Align()) {
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
  bool Refuse(std::string reason) {
    evidence_.failure = std::move(reason);
    return false;
  }

  bool Align() {
    if (reference_.frame != SceneFrame::kReferenceMarker) {
      return Refuse(
          "the reference scan did not see its reference marker well enough, so it has no height "
          "map; scan the reference again with that "
          "marker in view");
    }
    if (!reference_.height_map) {
      return Refuse(
          "the reference scan measured no surface around its reference marker, so it has no height "
          "map; lay the marker flat beside the "
          "body and scan the reference again");
    }
    const double since_s = Now();
    const int needed = options_.limits.min_shared_markers;
    AlignmentOutcome outcome = AlignScenes(reference_.markers, current_.markers, options_.preset,
                                           options_.markers, needed);
    result_.warnings = std::move(outcome.warnings);
    evidence_.markers = std::move(outcome.markers);
    if (!outcome.alignment) {
      const std::vector<std::string> refusals = RefusalsOfMarkers(evidence_.markers, needed);
      return Refuse(refusals.empty() ? "the shared markers determine no alignment"
                                     : refusals.front());
    }
    result_.alignment = std::move(outcome.alignment);
    Lap("alignment", since_s);
    return true;
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
          reference_body_ = FindBody(reference_cloud_);
        },
        [&] {
          current_cloud_ = SceneCloud(current_, StretchedAlignment());
          CheckStop(options_.stop);
          current_body_ = FindBody(current_cloud_);
        });
    if (!reference_body_.support)
      result_.warnings.push_back(
          "no flat support was found in the reference scan: all of it counts as body");
    if (!current_body_.support)
      result_.warnings.push_back(
          "no flat support was found in the current scan: all of it counts as body");
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
      return Refuse(
          options_.region_polygon_m.empty()
              ? "the reference scan shows no body over its support; check the reference scan"
              : "the reference scan measured nothing inside the region; draw the region on the "
                "body");
    }
    const GridShape& grid = reference_.height_map->grid;
    BodyMotionInput input{reference_cloud_, reference_body_, current_cloud_, current_body_,
                          nullptr,          *centroid,       options_.stop};
    if (!options_.region_polygon_m.empty()) {
      input.in_region = [&](const Eigen::Vector3d& p) {
        const auto cell = grid.cell(p.x(), p.y());
        return cell && result_.region_mask[*cell] != 0;
      };
    }
    const std::optional<SurfaceMotion> surface = EstimateBodyMotion(input);
    if (!surface)
      return Refuse(
          "the current scan does not look like this reference: no motion of the body explains it");

    BodyMotion motion;
    motion.T = surface->T;
    motion.centroid_m = *centroid;
    motion.inlier_fraction = surface->inlier_fraction;
    const std::optional<SharedSensor> sensor =
        JoinSensors({.reference = reference_,
                     .current = current_,
                     .alignment = *result_.alignment,
                     .T_motion = motion.T,
                     .centroid_m = *centroid,
                     .in_region = [&](const Eigen::Vector3d& p) { return IsOnRegion(p); }});
    if (sensor) JoinSensor(*sensor, motion);
    motion.uncertainty =
        Uncertainty({.alignment = *result_.alignment,
                     .surface = surface->covariance,
                     .T_motion = motion.T,
                     .centroid_m = *centroid,
                     .sensor = sensor ? std::optional(sensor->covariance) : std::nullopt,
                     .breathing_m = std::hypot(evidence_.reference_breathing_m,
                                               evidence_.current_breathing_m)});
    motion.covariance = motion.uncertainty.Total();
    result_.motion = motion;
    Lap("motion", since_s);
    return true;
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
                      .T_iec_reference = options_.T_iec_reference,
                      .marker_kind = options_.marker_kind,
                      .posture = options_.posture,
                      .deformation = result_.deformation ? &*result_.deformation : nullptr,
                      .hole_centre_m = result_.region->hole_centre_m});
    const std::optional<PatientPosture> posture =
        result_.body_parts->by_posture ? std::optional(options_.posture) : std::nullopt;
    result_.correction =
        CorrectionOf(motion.T, motion.covariance, motion.centroid_m,
                     options_.isocentre_m.value_or(motion.centroid_m), options_.T_iec_reference,
                     options_.marker_kind, posture, result_.body_parts->patient);
    evidence_.coverage = result_.region->coverage;
    evidence_.largest_hole_m = result_.region->largest_hole_m;
    evidence_.hole_place = result_.body_parts->hole_place;
    TakeNumbers();
    if (options_.marker_kind == MarkerKind::kCouch) {
      result_.warnings.emplace_back(
          "the markers are fixed to the couch: posture only, shifts are refused");
    }
    Lap("trust", since_s);
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
  CheckScenesMatch(reference, current);
  return Comparer(reference, current, options).Run();
}

}  // namespace plumb
