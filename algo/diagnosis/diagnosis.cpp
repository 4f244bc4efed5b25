// SPDX-License-Identifier: Apache-2.0
#include "algo/diagnosis/diagnosis.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "algo/base/statistics.hpp"
#include "algo/base/units.hpp"
#include "words/diagnosis.hpp"

namespace plumb {
namespace {

// Depth of consumer sensors errs by about 1 %, prints that were fitted to the page by 3 to 6 %.
constexpr double kSensorScale = 0.01;
constexpr double kUsualScale = 2 * kSensorScale;
// From here on neither a print nor a sensor explains the factor: a number was entered wrongly.
constexpr double kWrongNumber = 0.1;
// Two ratios of one sweep that differ by more are not of the same print: the ratio of a marker that
// is seen well scatters by less than 1 %.
constexpr double kSameSize = 0.05;
// Scatter of the ratios of one marker from view to view. The two images of a sweep whose clocks
// differ by a frame scatter by 1 to 4 %, depth in reverse order by 9 %, those of two different
// sweeps by 20 % and more.
constexpr double kNotTogether = 0.06;
// A print of the wrong size is wrong by the same amount in every view. If this many markers deviate
// from the common ratio and scatter by more than this, the depth image does not belong to them.
constexpr double kUnsteady = 0.03;
constexpr int kUnsteadyMarkers = 3;
constexpr int kViewsForRatio = 3;
// Below, an offset does no harm: 15 ms moved a result by less than its interval, 33 ms by 6 mm.
constexpr double kHarmfulOffset_s = 0.020;
constexpr double kOffsetSigmas = 4.0;
constexpr double kRepeatedToReport = 0.05;
constexpr double kOutOfRangeToReport = 0.2, kOutOfRangeToRefuse = 0.6;
// Colour images of usual rooms have a mean of 100 to 160, and 0 to 5 % of white pixels.
constexpr double kDark = 25, kWhite = 0.4, kFlickers = 0.1;
// Sweeps of 10 s have 0.1 to 0.5; at 1, an exposure of 20 ms smears over a fiftieth of the image.
constexpr double kFast_widths_per_s = 1.0;
// Chi-square for each term: a prior that holds gives 1 at most, since the sweep does not determine
// every term.
constexpr double kChi2ToReport = 2.0, kChi2ToRefuse = 4.0;
// For assumed cameras, which are less accurate than stated ones. Where they led to lengths within
// 0.4 % the sweeps of eight units gave up to 4.5; where depth was not registered, or lengths were
// wrong by 11 to 17 %, 7.0 and more.
constexpr double kChi2OfAssumedToRefuse = 5.5;
// A result that rests on an assumed camera is refused if its lengths are off by more than this.
constexpr double kAssumedScale = 0.03;
// Units of depth for a metre that recordings have: the usual 1000, 5000 (TUM), 10000 and 4000
// (RealSense), 256 (KITTI), 100.
constexpr std::array kDepthUnits = {1000.0, 5000.0, 10000.0, 4000.0, 256.0, 100.0};

// Whether the factor is one between millimetres and another unit of depth.
bool IsFactorOfUnits(double ratio) {
  return std::ranges::any_of(kDepthUnits, [&](double unit) {
    const double factor = unit / 1000;
    return unit != 1000 && (std::abs(ratio / factor - 1) < 0.5 * kSameSize ||
                            std::abs(ratio * factor - 1) < 0.5 * kSameSize);
  });
}

// The unit in use that is nearest to a measured one, where one is near; that itself otherwise.
double NearestUnits(double units_per_metre) {
  for (const double unit : kDepthUnits)
    if (std::abs(units_per_metre / unit - 1) < 0.5 * kSameSize) return unit;
  return units_per_metre;
}

// The largest group of ratios that agree with one of them, of equal ones that which is nearer to
// what is stated: its median.
double CommonRatio(const std::vector<MarkerDepth>& markers) {
  std::size_t most = 0;
  std::vector<double> best;
  for (const MarkerDepth& centre : markers) {
    std::vector<double> group;
    for (const MarkerDepth& other : markers)
      if (std::abs(other.ratio / centre.ratio - 1) < kSameSize) group.push_back(other.ratio);
    const bool nearer = best.empty() || std::abs(centre.ratio - 1) < std::abs(best.front() - 1);
    if (group.size() < most || (group.size() == most && !nearer)) continue;
    most = group.size();
    best = std::move(group);
  }
  return TakeMedian(best);
}

std::vector<MarkerDepth> WellMeasured(const Symptoms& symptoms) {
  std::vector<MarkerDepth> markers;
  for (const MarkerDepth& marker : symptoms.marker_depths)
    if (marker.num_views >= kViewsForRatio) markers.push_back(marker);
  return markers;
}

Message NameOf(DepthLayout layout) {
  if (layout == DepthLayout::kMirrored) return say::diagnosis::LayoutMirrored();
  if (layout == DepthLayout::kUpsideDown) return say::diagnosis::LayoutUpsideDown();
  return say::diagnosis::LayoutTurned();
}

bool AssumedCamerasUnfit(const CalibrationFit& fit) {
  return fit.num_terms > 0 && fit.chi2 / fit.num_terms > kChi2OfAssumedToRefuse;
}

// Markers that are not of the common size.
// @return whether depth is not that of the markers.
bool JudgeSizes(const std::vector<MarkerDepth>& markers, double common,
                std::vector<Finding>& findings) {
  std::vector<std::int64_t> apart;
  int num_unsteady = 0;
  for (const MarkerDepth& marker : markers) {
    if (std::abs(marker.ratio / common - 1) < kSameSize) continue;
    apart.push_back(marker.id);
    if (marker.scatter > kUnsteady * marker.ratio) ++num_unsteady;
  }
  if (num_unsteady >= kUnsteadyMarkers) {
    findings.push_back({FindingLevel::kRefusal, say::diagnosis::ImagesApart()});
    return true;
  }
  if (!apart.empty()) {
    // A few of them do no harm, since the solve weighs each against the others.
    const FindingLevel level =
        3 * apart.size() >= markers.size() ? FindingLevel::kRefusal : FindingLevel::kWarning;
    const auto count = static_cast<std::int64_t>(apart.size());
    findings.push_back({level, say::diagnosis::MarkersApart(count, std::move(apart))});
  }
  return false;
}

// Where depth and markers differ by more than prints and sensors do.
Message OfWrongNumber(const Symptoms& symptoms, double common, double side_mm) {
  if (!IsFactorOfUnits(common))
    return say::diagnosis::UnitOrSide(common, side_mm, common * symptoms.focal_px);
  if (!symptoms.depth_unit_assumed || !(symptoms.depth_units_per_metre > 0))
    return say::diagnosis::DepthUnit(common);
  return say::diagnosis::DepthUnitUnstated(symptoms.depth_units_per_metre,
                                           NearestUnits(symptoms.depth_units_per_metre * common));
}

// @return whether the units are wrong, so that nothing else can be judged.
bool JudgeMarkerDepths(const Symptoms& symptoms, std::vector<Finding>& findings) {
  const std::vector<MarkerDepth> markers = WellMeasured(symptoms);
  if (markers.empty()) {
    // Without markers, a wrong focal length passes for another motion: chi-square may be below 1.
    if (symptoms.cameras_assumed && !AssumedCamerasUnfit(symptoms.calibration))
      findings.push_back({FindingLevel::kRefusal, say::diagnosis::CamerasUnconfirmed()});
    if (symptoms.depth_unit_assumed)
      findings.push_back({FindingLevel::kRefusal, say::diagnosis::DepthUnitUnknown()});
    return false;
  }
  if (symptoms.depth_layout != DepthLayout::kAsStated) {
    findings.push_back(
        {FindingLevel::kRefusal, say::diagnosis::DepthLayout(NameOf(symptoms.depth_layout))});
    return true;
  }
  std::vector<double> scatter;
  for (const MarkerDepth& marker : markers) scatter.push_back(marker.scatter / marker.ratio);
  if (TakeMedian(scatter) > kNotTogether) {
    findings.push_back({FindingLevel::kRefusal, say::diagnosis::ImagesApart()});
    return true;
  }
  const double common = CommonRatio(markers);
  if (JudgeSizes(markers, common, findings)) return true;
  if (std::abs(common - 1) <= kUsualScale) return false;
  if (symptoms.cameras_assumed && !IsFactorOfUnits(common)) {
    const bool refused = std::abs(common - 1) > kAssumedScale;
    findings.push_back(
        {refused ? FindingLevel::kRefusal : FindingLevel::kWarning,
         say::diagnosis::CamerasOrSize(common, symptoms.focal_px, common * symptoms.focal_px)});
    return refused;
  }
  const double side_mm = symptoms.marker_length_m * common / kMillimetre;
  if (std::abs(common - 1) <= kWrongNumber) {
    // In dark images marker edges are found in the wrong place, so the light comes first.
    if (symptoms.median_gray < kDark) return false;
    findings.push_back(
        {FindingLevel::kWarning, say::diagnosis::PrintOrSensor(100 * std::abs(common - 1), side_mm,
                                                               common * symptoms.focal_px)});
    return false;
  }
  findings.push_back({FindingLevel::kRefusal, OfWrongNumber(symptoms, common, side_mm)});
  return true;
}

// @return whether depth lies beside what colour shows, so that nothing else can be judged by it.
// Assumed cameras are still judged: where they do not fit, no scene is made.
bool JudgeDepthCamera(const Symptoms& symptoms, std::vector<Finding>& findings) {
  if (!symptoms.depth_camera_unknown) return false;
  findings.push_back({FindingLevel::kRefusal, say::diagnosis::DepthCameraUnknown()});
  return !symptoms.cameras_assumed;
}

void JudgeStreams(const Symptoms& symptoms, std::vector<Finding>& findings) {
  if (symptoms.stream_offset) {
    const auto& [offset_s, sigma_s] = *symptoms.stream_offset;
    if (std::abs(offset_s) > kHarmfulOffset_s && std::abs(offset_s) > kOffsetSigmas * sigma_s)
      findings.push_back({FindingLevel::kRefusal, offset_s > 0
                                                      ? say::diagnosis::DepthLate(offset_s)
                                                      : say::diagnosis::DepthEarly(-offset_s)});
  }
  const auto repeated = [&](std::int64_t count, Message which) {
    if (static_cast<double>(count) <= kRepeatedToReport * static_cast<double>(symptoms.num_frames))
      return;
    findings.push_back({FindingLevel::kWarning,
                        say::diagnosis::Repeated(count, symptoms.num_frames, std::move(which))});
  };
  repeated(symptoms.num_repeated_depth, say::diagnosis::ImagesDepth());
  repeated(symptoms.num_repeated_color, say::diagnosis::ImagesColor());
}

void JudgeRange(const Symptoms& symptoms, std::vector<Finding>& findings) {
  const double outside = symptoms.share_near + symptoms.share_far;
  if (outside <= kOutOfRangeToReport) return;
  const FindingLevel level =
      outside > kOutOfRangeToRefuse ? FindingLevel::kRefusal : FindingLevel::kWarning;
  findings.push_back({level, symptoms.share_near >= symptoms.share_far
                                 ? say::diagnosis::TooNear(100 * outside, symptoms.nearest_m)
                                 : say::diagnosis::TooFar(100 * outside, symptoms.farthest_m)});
}

void JudgeExposure(const Symptoms& symptoms, std::vector<Finding>& findings) {
  const auto warn = [&](bool seen, const Message& cause) {
    if (seen) findings.push_back({FindingLevel::kWarning, cause});
  };
  warn(symptoms.median_gray < kDark, say::diagnosis::TooDark(symptoms.median_gray));
  warn(symptoms.share_white > kWhite, say::diagnosis::TooBright(100 * symptoms.share_white));
  warn(symptoms.share_flickers > kFlickers,
       say::diagnosis::Flickers(100 * symptoms.share_flickers));
  warn(symptoms.widths_per_s > kFast_widths_per_s, say::diagnosis::TooFast(symptoms.widths_per_s));
}

void JudgeForeignMarkers(const Symptoms& symptoms, std::vector<Finding>& findings) {
  if (!symptoms.foreign_markers) return;
  const ForeignMarkers& foreign = *symptoms.foreign_markers;
  using Kind = ForeignMarkers::Kind;
  // A scene without markers is not compared anyway; this is why.
  if (foreign.kind == Kind::kMirrored)
    findings.push_back({FindingLevel::kRefusal, say::diagnosis::Mirrored()});
  if (foreign.kind == Kind::kInverted)
    findings.push_back({FindingLevel::kRefusal, say::diagnosis::Inverted()});
  if (foreign.kind == Kind::kOtherDictionary)
    findings.push_back(
        {FindingLevel::kRefusal, say::diagnosis::OtherDictionary(foreign.dictionary)});
}

void JudgeCalibration(const Symptoms& symptoms, std::vector<Finding>& findings) {
  const CalibrationFit& fit = symptoms.calibration;
  if (fit.num_terms == 0) return;
  const double chi2_per_term = fit.chi2 / fit.num_terms;
  if (symptoms.cameras_assumed) {  // Their single terms mean nothing.
    if (AssumedCamerasUnfit(fit))
      findings.push_back({FindingLevel::kRefusal,
                          say::diagnosis::CamerasUnstated(chi2_per_term, kChi2OfAssumedToRefuse)});
    return;
  }
  // Sound sweeps gave -12 to 12 ms, a filter over time -23 to -52.
  if (fit.delay_s < -kHarmfulOffset_s) {
    findings.push_back({FindingLevel::kRefusal, say::diagnosis::DepthLags(-fit.delay_s)});
    return;
  }
  if (!(chi2_per_term > kChi2ToReport)) return;
  const FindingLevel level =
      chi2_per_term > kChi2ToRefuse ? FindingLevel::kRefusal : FindingLevel::kWarning;
  findings.push_back({level, say::diagnosis::Calibration(chi2_per_term, fit.worst_term,
                                                         fit.worst_value, fit.worst_sigma)});
}

}  // namespace

double ScaleDoubt(const Symptoms& symptoms) {
  const std::vector<MarkerDepth> markers = WellMeasured(symptoms);
  if (markers.empty()) return 0.0;
  const double off = std::abs(CommonRatio(markers) - 1);
  return off > kUsualScale ? off + kSensorScale : 0.0;
}

bool IsOfAssumedCameras(const Message& refusal) {
  return refusal.id() == say::diagnosis::CamerasUnstated(0, 0).id() ||
         refusal.id() == say::diagnosis::CamerasOrSize(0, 0, 0).id();
}

std::vector<Finding> Diagnose(const Symptoms& symptoms) {
  std::vector<Finding> findings;
  JudgeForeignMarkers(symptoms, findings);
  const std::size_t before = findings.size();
  JudgeStreams(symptoms, findings);
  const bool clocks_differ =
      findings.size() > before && findings[before].level == FindingLevel::kRefusal;
  // Depth of another moment disagrees with the markers because of its time, and depth of another
  // camera because of its place.
  const bool misplaced = JudgeDepthCamera(symptoms, findings);
  const bool wrong_numbers = !clocks_differ && (misplaced || JudgeMarkerDepths(symptoms, findings));
  if (!wrong_numbers) JudgeRange(symptoms, findings);
  // Colour images that are mirrored do not fit depth, so the solve finds no calibration.
  const bool mirrored =
      symptoms.foreign_markers && symptoms.foreign_markers->kind == ForeignMarkers::Kind::kMirrored;
  if (!clocks_differ && !wrong_numbers && !mirrored) JudgeCalibration(symptoms, findings);
  JudgeExposure(symptoms, findings);
  std::ranges::stable_sort(findings,
                           [](const Finding& a, const Finding& b) { return a.level > b.level; });
  return findings;
}

}  // namespace plumb
