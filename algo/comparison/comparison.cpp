#include "algo/comparison/comparison.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "algo/comparison/body_motion.hpp"
#include "algo/comparison/deviation.hpp"
#include "algo/comparison/region.hpp"
#include "algo/comparison/scene_alignment.hpp"
#include "algo/comparison/surface.hpp"
#include "algo/types/check_stop.hpp"
#include "algo/types/errors.hpp"

namespace plumb {
namespace {

constexpr double kSegmentationSpacing_m = 0.01;
constexpr double kSegmentationSmoothing_m = 0.03;
constexpr double kCloudReach_m = 0.004;  // of the discs of a cloud with points every 3 mm
constexpr double kCloudSpacing_m = 0.003;
// What no residual shows: errors of a whole scan (scale, bending) that both the markers and the body follow.
constexpr double kSystematicShift_m = 0.3 * kMillimetre;
constexpr double kSystematicAngle_rad = 0.05 * kDegree;
constexpr double kWeakShare = 0.5;  // of the tolerance: from there on a direction is named as weak

using Names = std::array<const char*, 6>;
constexpr Names kNames = {"vertical", "longitudinal", "lateral", "pitch", "roll", "yaw"};

// The six numbers in the order of kNames; absent where refused.
std::array<std::optional<double>, 6> Values(const CouchNumbers& numbers) {
  return {numbers.vertical_mm, numbers.longitudinal_mm, numbers.lateral_mm, numbers.pitch_deg, numbers.roll_deg, numbers.yaw_deg};
}

const char* Unit(std::size_t i) { return i < 3 ? "mm" : "deg"; }

double Tolerance(const CompareOptions& options, std::size_t i) {
  return i < 3 ? options.shift_tolerance_m / kMillimetre : options.rotation_tolerance_rad / kDegree;
}

void CheckOptions(const CompareOptions& options) {
  const auto positive = [](double value, const char* name) {
    if (!(value > 0) || !std::isfinite(value))
      throw std::invalid_argument(fmt::format("comparison: {} must be positive, got {}", name, value));
  };
  positive(options.shift_tolerance_m, "shift tolerance");
  positive(options.rotation_tolerance_rad, "rotation tolerance");
  positive(options.moved_marker_m, "moved-marker limit");
  positive(options.moved_marker_sigmas, "moved-marker sigmas");
  positive(options.max_hole_m, "largest hole");
  positive(options.max_residual_p95_m, "residual limit");
  positive(options.max_lost_s, "lost-tracking limit");
  if (!(options.min_coverage >= 0 && options.min_coverage <= 1)) throw std::invalid_argument("comparison: coverage limit must lie in 0..1");
  if (!options.region_polygon_m.empty() && options.region_polygon_m.size() < 3) {
    throw std::invalid_argument(fmt::format("comparison: a region needs at least 3 points, got {}", options.region_polygon_m.size()));
  }
  for (const Eigen::Vector2d& p : options.region_polygon_m) {
    if (!p.allFinite()) throw std::invalid_argument("comparison: the region holds a value that is not finite");
  }
  if (options.isocentre_m && !options.isocentre_m->allFinite()) throw std::invalid_argument("comparison: the isocentre is not finite");
  if (!IsFinite(options.T_iec_reference)) throw std::invalid_argument("comparison: the IEC transform is not finite");
}

void CheckScenesMatch(const Scene& reference, const Scene& current) {
  if (reference.marker_dictionary != current.marker_dictionary) {
    throw DataError(
        fmt::format("cannot compare the scenes: the reference was made with marker dictionary {}, the current one with {}; scan both "
                    "with the same markers",
                    reference.marker_dictionary, current.marker_dictionary));
  }
  if (!(std::abs(reference.marker_length_m - current.marker_length_m) < 1e-6)) {
    throw DataError(
        fmt::format("cannot compare the scenes: the reference was made with markers of {} m, the current one with {} m; scan both "
                    "with the same markers",
                    reference.marker_length_m, current.marker_length_m));
  }
}

// The scene's surface as a cloud with normals, in the reference frame.
PointCloud SceneCloud(const Scene& scene, const Eigen::Affine3d& T_reference_scene) {
  const bool has_cloud = !scene.cloud.empty() && scene.cloud.normals.size() == scene.cloud.size();
  if (has_cloud) return TransformedCloud(T_reference_scene, scene.cloud);
  if (scene.height_map) return TransformedCloud(T_reference_scene, CloudOfHeightMap(*scene.height_map));
  return {};
}

Matrix6d MovedCovariance(const Matrix6d& covariance, const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  Matrix6d J = Matrix6d::Identity();
  J.bottomLeftCorner<3, 3>() = -Skew(to - from);
  return J * covariance * J.transpose();
}

// One comparison in progress: Compare() runs its steps in order.
class Comparer {
 public:
  Comparer(const Scene& reference, const Scene& current, const CompareOptions& options)
      : reference_(reference), current_(current), options_(options) {}

  Comparison Run() {
    if (Align()) {
      Segment();
      CheckStop(options_.stop);
      Heights();
      CheckStop(options_.stop);
      if (Move()) {
        CheckStop(options_.stop);
        Judge();
      }
    }
    if (result_.reasons.empty()) Decide();
    Lap("total", start_s_);
    return std::move(result_);
  }

 private:
  [[nodiscard]] double Now() const { return options_.now_s ? options_.now_s() : 0.0; }
  void Lap(const char* name, double since_s) {
    if (options_.now_s) result_.timings_s[name] = Now() - since_s;
  }
  bool Refuse(std::string reason) {
    result_.verdict = Verdict::kNoAnswer;
    result_.reasons.push_back(std::move(reason));
    return false;
  }

  bool Align() {
    if (reference_.frame != SceneFrame::kReferenceMarker) {
      return Refuse(
          "the reference scan did not see its reference marker well enough, so it has no height map; scan the reference again with that "
          "marker in view");
    }
    if (!reference_.height_map) {
      return Refuse(
          "the reference scan measured no surface around its reference marker, so it has no height map; lay the marker flat beside the "
          "body and scan the reference again");
    }
    const double since_s = Now();
    AlignmentOutcome outcome = AlignScenes(reference_.markers, current_.markers, options_);
    result_.warnings = std::move(outcome.warnings);
    if (!outcome.alignment) return Refuse(std::move(outcome.failure));
    result_.alignment = std::move(outcome.alignment);
    Lap("alignment", since_s);
    return true;
  }

  // From the current scene to the reference frame, its length and width corrected.
  [[nodiscard]] Eigen::Affine3d StretchedAlignment() const {
    const Alignment& alignment = *result_.alignment;
    return Eigen::Translation3d(alignment.centre_m) * Eigen::Affine3d(alignment.stretch) * Eigen::Translation3d(-alignment.centre_m) *
           alignment.T_reference_current;
  }

  void Segment() {
    const double since_s = Now();
    reference_cloud_ = SceneCloud(reference_, Eigen::Affine3d::Identity());
    current_cloud_ = SceneCloud(current_, StretchedAlignment());
    CheckStop(options_.stop);
    reference_body_ = FindBody(MakeSurface(reference_cloud_, kSegmentationSpacing_m, kSegmentationSmoothing_m));
    CheckStop(options_.stop);
    current_body_ = FindBody(MakeSurface(current_cloud_, kSegmentationSpacing_m, kSegmentationSmoothing_m));
    if (!reference_body_.support) result_.warnings.push_back("no flat support was found in the reference scan: all of it counts as body");
    if (!current_body_.support) result_.warnings.push_back("no flat support was found in the current scan: all of it counts as body");
    result_.region_mask = RegionMask(*reference_.height_map, reference_body_, options_.region_polygon_m);
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
    if (current_.height_map) return ResampledHeightMap(*current_.height_map, T * StretchedAlignment(), grid);
    return HeightMapOfCloud(TransformedCloud(T, current_cloud_), kCloudReach_m, grid);
  }

  bool Move() {
    const double since_s = Now();
    const std::optional<Eigen::Vector3d> centroid = RegionCentroid(*reference_.height_map, result_.region_mask);
    if (!centroid) {
      return Refuse(options_.region_polygon_m.empty()
                        ? "the reference scan shows no body over its support; check the reference scan"
                        : "the reference scan measured nothing inside the region; draw the region on the body");
    }
    const GridShape& grid = reference_.height_map->grid;
    BodyMotionInput input{reference_cloud_, reference_body_, current_cloud_, current_body_, nullptr, *centroid, options_.stop};
    if (!options_.region_polygon_m.empty()) {
      input.in_region = [&](const Eigen::Vector3d& p) {
        const auto cell = grid.cell(p.x(), p.y());
        return cell && result_.region_mask[*cell] != 0;
      };
    }
    const std::optional<SurfaceMotion> surface = EstimateBodyMotion(input);
    if (!surface) return Refuse("the current scan does not look like this reference: no motion of the body explains it");

    BodyMotion motion;
    motion.T = surface->T;
    motion.centroid_m = *centroid;
    motion.inlier_share = surface->inlier_share;
    const Alignment& alignment = *result_.alignment;
    motion.covariance = surface->covariance + MovedCovariance(alignment.covariance, alignment.centre_m, motion.T * *centroid);
    motion.covariance.diagonal().head<3>().array() += kSystematicAngle_rad * kSystematicAngle_rad;
    motion.covariance.diagonal().tail<3>().array() += kSystematicShift_m * kSystematicShift_m;
    result_.motion = motion;
    Lap("motion", since_s);
    return true;
  }

  void Judge() {
    const double since_s = Now();
    BodyMotion& motion = *result_.motion;
    result_.region = CoverageOf(*reference_.height_map, result_.region_mask, current_cloud_, kCloudSpacing_m, motion.T);
    CheckStop(options_.stop);
    const HeightMap corrected = CurrentHeight(motion.T.inverse());
    result_.deviation_after = HeightDifference(corrected, *reference_.height_map);
    Residuals(corrected);
    result_.body_parts = DescribeBody({.reference = *reference_.height_map,
                                       .deviation_after = *result_.deviation_after,
                                       .region_mask = result_.region_mask,
                                       .body_mask = RegionMask(*reference_.height_map, reference_body_, {}),
                                       .T_motion = motion.T,
                                       .T_iec_reference = options_.T_iec_reference,
                                       .marker_kind = options_.marker_kind,
                                       .posture = options_.posture});
    const std::optional<PatientPosture> posture = result_.body_parts->by_posture ? std::optional(options_.posture) : std::nullopt;
    result_.correction = CorrectionOf(motion.T, motion.covariance, motion.centroid_m, options_.isocentre_m.value_or(motion.centroid_m),
                                      options_.T_iec_reference, options_.marker_kind, posture);
    const auto u95 = Values(result_.correction->u95);
    for (std::size_t i = 0; i < 6; ++i) {
      if (u95[i] && *u95[i] > kWeakShare * Tolerance(options_, i)) motion.weak_directions.push_back({kNames[i], *u95[i], Unit(i)});
    }
    Lap("trust", since_s);
  }

  void Residuals(const HeightMap& corrected) {
    const HeightMap distance = SignedDistance(corrected, *reference_.height_map, result_.region_mask);
    std::vector<float> magnitudes;
    for (std::size_t i = 0; i < distance.z.size(); ++i) {
      // What moved with the room and not with the body says nothing about the correction.
      if (result_.region_mask[i] == 0) result_.deviation_after->z[i] = std::numeric_limits<float>::quiet_NaN();
      if (std::isfinite(distance.z[i])) magnitudes.push_back(std::abs(distance.z[i]));
    }
    if (magnitudes.empty()) return;
    const auto quantile = [&](double q) {
      const auto nth = magnitudes.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(magnitudes.size() - 1));
      std::nth_element(magnitudes.begin(), nth, magnitudes.end());
      return static_cast<double>(*nth);
    };
    result_.motion->residual_median_m = quantile(0.5);
    result_.motion->residual_p95_m = quantile(0.95);
  }

  // Reasons in the order of the contract; the first decides.
  void Decide() {
    if (options_.preset == Preset::kBest) CollectDoubts();
    if (!result_.reasons.empty()) {
      result_.verdict = Verdict::kNoAnswer;
      return;
    }
    const auto value = Values(result_.correction->value);
    const auto u95 = Values(result_.correction->u95);
    std::vector<std::string> outside;
    for (std::size_t i = 0; i < 6; ++i) {
      if (!value[i] || std::abs(*value[i]) + *u95[i] <= Tolerance(options_, i)) continue;
      outside.push_back(fmt::format("{} {:+.1f} {} ({})", kNames[i], *value[i], Unit(i), result_.correction->words[i]));
    }
    result_.verdict = outside.empty() ? Verdict::kInTolerance : Verdict::kMove;
    const std::string limits = fmt::format("{:g} mm and {:g} deg", Tolerance(options_, 0), Tolerance(options_, 3));
    result_.reasons.push_back(outside.empty() ? fmt::format("every value and its uncertainty lie within {}", limits)
                                              : fmt::format("outside {}: {}", limits, fmt::join(outside, ", ")));
    if (options_.marker_kind == MarkerKind::kCouch) {
      result_.warnings.push_back("the markers are fixed to the couch: posture only, shifts are refused");
    }
  }

  void CollectDoubts() {
    std::vector<std::string>& reasons = result_.reasons;
    // The region would be all that was measured, and a couch that stands still would hide that the body moved.
    if (!reference_body_.support && options_.region_polygon_m.empty()) {
      reasons.push_back(
          "no flat support was found in the reference scan, so nothing tells the body from what it lies on; draw a region on the body, or "
          "scan the reference again with more of the couch in view");
    }
    if (result_.region->coverage < options_.min_coverage) {
      reasons.push_back(fmt::format("the current scan covers {:.0f} % of the region, at least {:.0f} % are needed; sweep all of it",
                                    100 * result_.region->coverage, 100 * options_.min_coverage));
    }
    if (result_.region->largest_hole_m > options_.max_hole_m) {
      reasons.push_back(
          fmt::format("the current scan has a hole of {:.0f} mm in the region at x {:.2f} m, y {:.2f} m; at most {:.0f} mm are "
                      "allowed; sweep over it",
                      result_.region->largest_hole_m / kMillimetre, result_.region->hole_centre_m.x(), result_.region->hole_centre_m.y(),
                      options_.max_hole_m / kMillimetre));
    }
    if (result_.motion->residual_p95_m > options_.max_residual_p95_m) {
      reasons.push_back(
          fmt::format("the body does not look like this reference: 5 % of the region stay {:.0f} mm away after the best motion",
                      result_.motion->residual_p95_m / kMillimetre));
    }
    for (const auto& [scene, name] : {std::pair(&reference_, "reference"), std::pair(&current_, "current")}) {
      if (!(scene->longest_lost_s > options_.max_lost_s)) continue;
      reasons.push_back(fmt::format("tracking was lost for {:.1f} s in the {} scan, or no image came; sweep again, more slowly",
                                    scene->longest_lost_s, name));
    }
    const auto u95 = Values(result_.correction->u95);
    for (std::size_t i = 0; i < 6; ++i) {
      if (!u95[i] || *u95[i] <= Tolerance(options_, i)) continue;
      reasons.push_back(fmt::format("{} is not well seen: +-{:.1f} {} at 95 %, the tolerance is {:g} {}", kNames[i], *u95[i], Unit(i),
                                    Tolerance(options_, i), Unit(i)));
    }
  }

  const Scene& reference_;
  const Scene& current_;
  const CompareOptions& options_;
  double start_s_ = Now();
  Comparison result_;
  PointCloud reference_cloud_;  // reference frame
  PointCloud current_cloud_;    // reference frame, after alignment
  Body reference_body_;
  Body current_body_;
};

}  // namespace

const char* Name(Verdict verdict) {
  switch (verdict) {
    case Verdict::kInTolerance:
      return "in_tolerance";
    case Verdict::kMove:
      return "move";
    case Verdict::kNoAnswer:
      return "no_answer";
  }
  return "no_answer";
}

Comparison Compare(const Scene& reference, const Scene& current, const CompareOptions& options) {
  CheckOptions(options);
  CheckScenesMatch(reference, current);
  return Comparer(reference, current, options).Run();
}

}  // namespace plumb
