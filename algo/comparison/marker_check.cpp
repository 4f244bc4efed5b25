#include "algo/comparison/marker_check.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "algo/comparison/scene_alignment.hpp"
#include "algo/geometry/rigid_fit.hpp"

namespace plumb {
namespace {

constexpr double kAssumed_percent = 1e-3;
constexpr double kNotKnown = std::numeric_limits<double>::quiet_NaN();

Eigen::Vector3d CentreOf(const SceneMarker& marker) {
  return (marker.corners[0] + marker.corners[1] + marker.corners[2] + marker.corners[3]) / 4.0;
}

double SideOf(const SceneMarker& marker) {
  double sum = 0.0;
  for (std::size_t i = 0; i < 4; ++i)
    sum += (marker.corners[(i + 1) % 4] - marker.corners[i]).norm();
  return sum / 4.0;
}

// Size of the second map relative to the first, from the spread of the shared centres about their
// mean.
double ScaleOf(const std::vector<std::pair<const SceneMarker*, const SceneMarker*>>& shared) {
  if (shared.size() < 2) return kNotKnown;
  Eigen::Vector3d before = Eigen::Vector3d::Zero(), now = Eigen::Vector3d::Zero();
  for (const auto& [a, b] : shared) before += CentreOf(*a), now += CentreOf(*b);
  before /= static_cast<double>(shared.size()), now /= static_cast<double>(shared.size());
  double spread_before = 0.0, spread_now = 0.0;
  for (const auto& [a, b] : shared) {
    spread_before += (CentreOf(*a) - before).squaredNorm();
    spread_now += (CentreOf(*b) - now).squaredNorm();
  }
  return spread_before > 0 ? std::sqrt(spread_now / spread_before) : kNotKnown;
}

class Checker {
 public:
  Checker(const Scene& scene, const std::optional<MarkerBaseline>& baseline,
          const MarkerCheckLimits& limits)
      : scene_(scene),
        baseline_(baseline),
        limits_(limits),
        seen_(BaselineOf(scene, limits).markers) {}

  MarkerCheck Run() {
    Seen();
    if (baseline_ && SameMarkers()) Geometry();
    Sides();
    Depth();
    const bool passed = check_.reasons.empty() &&
                        std::all_of(check_.items.begin(), check_.items.end(),
                                    [](const MarkerCheckItem& item) { return item.passed; });
    check_.status = !passed     ? MarkerCheckStatus::kFailed
                    : baseline_ ? MarkerCheckStatus::kPassed
                                : MarkerCheckStatus::kNoBaseline;
    if (check_.status == MarkerCheckStatus::kNoBaseline) {
      check_.reasons.push_back(
          "there is no baseline yet: if the markers are known to be in place, set this check "
          "as the baseline");
    }
    return std::move(check_);
  }

 private:
  void Fail(std::string reason) { check_.reasons.push_back(std::move(reason)); }

  void AtMost(const char* name, double value, double limit, const char* unit, std::string note,
              const std::string& reason) {
    const bool passed = std::abs(value) <= limit;
    check_.items.push_back({name, value, limit, unit, passed, std::move(note)});
    if (!passed) Fail(reason);
  }

  void Seen() {
    std::vector<int> missing;
    if (baseline_) {
      for (const auto& [id, marker] : baseline_->markers) {
        if (!seen_.contains(id)) missing.push_back(id);
      }
    }
    const auto wanted =
        baseline_ ? baseline_->markers.size() : static_cast<std::size_t>(limits_.min_markers);
    const auto found = baseline_ ? wanted - missing.size() : seen_.size();
    const std::string names =
        missing.empty() ? "" : fmt::format("missing: {}", fmt::join(missing, ", "));
    check_.items.push_back({"markers_seen", static_cast<double>(found), static_cast<double>(wanted),
                            "", found >= wanted, names});
    if (found >= wanted) return;
    Fail(missing.empty()
             ? fmt::format("{} markers were seen, at least {} are needed; sweep over all of them",
                           found, wanted)
             : fmt::format("markers {} were not seen well: check that they are there, clean and "
                           "uncovered, and sweep over all",
                           fmt::join(missing, ", ")));
  }

  bool SameMarkers() {
    if (baseline_->dictionary == scene_.marker_dictionary &&
        std::abs(baseline_->marker_length_m - scene_.marker_length_m) < 1e-6)
      return true;
    Fail(
        fmt::format("the baseline was taken with markers {} of {} m, this check with {} of {} m; "
                    "take a new baseline",
                    baseline_->dictionary, baseline_->marker_length_m, scene_.marker_dictionary,
                    scene_.marker_length_m));
    return false;
  }

  // Baseline from sweep, fitted to the agreeing markers other than `id`, so that a marker does not
  // influence the fit that judges it. Nothing if they do not determine a pose.
  [[nodiscard]] std::optional<Pose> FitWithout(int id, const std::vector<int>& agreeing) const {
    std::vector<Eigen::Vector3d> before, now;
    for (const int other : agreeing) {
      if (other == id) continue;
      const MarkerCorners& known = baseline_->markers.at(other).corners;
      const MarkerCorners& seen = seen_.at(other).corners;
      before.insert(before.end(), known.begin(), known.end());
      now.insert(now.end(), seen.begin(), seen.end());
    }
    const RigidFit fit = FitRigid(before, now);
    return fit.valid ? std::optional(fit.T_a_b) : std::nullopt;
  }

  void Geometry() {
    const AlignmentOutcome outcome =
        AlignScenes(baseline_->markers, seen_, Preset::kBest, {}, limits_.min_markers);
    if (!outcome.alignment) {
      for (std::string& reason : RefusalsOfMarkers(outcome.markers, limits_.min_markers)) {
        Fail(std::move(reason));
      }
      return;
    }
    const std::vector<int>& agreeing = outcome.alignment->markers_used;
    std::vector<std::pair<const SceneMarker*, const SceneMarker*>> good;
    for (const int id : agreeing) good.emplace_back(&baseline_->markers.at(id), &seen_.at(id));
    double moved_m = 0.0;
    std::optional<int> worst;  // The alignment used at least one of them.
    for (const auto& [id, marker] : seen_) {
      const auto known = baseline_->markers.find(id);
      if (known == baseline_->markers.end()) continue;
      const Pose T = FitWithout(id, agreeing).value_or(outcome.alignment->T_reference_current);
      const double off_m = (T * CentreOf(marker) - CentreOf(known->second)).norm();
      if (!worst || off_m > moved_m) moved_m = off_m, worst = id;
    }
    const double misfit_mm = outcome.alignment->rms_m / kMillimetre,
                 moved_mm = moved_m / kMillimetre;
    AtMost("misfit", misfit_mm, limits_.max_misfit_m / kMillimetre, "mm", "",
           fmt::format(
               "the markers lie {:.1f} mm (RMS) from where they were, at most {:g} mm are allowed",
               misfit_mm, limits_.max_misfit_m / kMillimetre));
    AtMost("moved", moved_mm, limits_.max_moved_m / kMillimetre, "mm",
           fmt::format("marker {}", worst.value()),
           fmt::format("marker {} moved {:.0f} mm", worst.value(), moved_mm));
    const double scale = 100 * (ScaleOf(good) - 1);
    AtMost("scale", scale, 100 * limits_.max_scale_share, "%", "",
           fmt::format("the markers lie {:.2f} % farther apart than they did: the sensor's "
                       "calibration may have changed",
                       scale));
  }

  void Sides() {
    double worst = kNotKnown;
    std::optional<int> id_of_worst;
    for (const auto& [id, marker] : seen_) {
      const double off = 100 * (SideOf(marker) / scene_.marker_length_m - 1);
      if (!id_of_worst || std::abs(off) > std::abs(worst)) worst = off, id_of_worst = id;
    }
    // Preset `best` assumes that every marker has its nominal size, so that its sides were not
    // measured and cannot be checked.
    if (std::abs(worst) < kAssumed_percent) return;
    AtMost("side", worst, 100 * limits_.max_side_share, "%",
           id_of_worst ? fmt::format("marker {}", *id_of_worst) : "",
           id_of_worst
               ? fmt::format(
                     "marker {} is {:+.1f} % off its stated length: check the size of its print",
                     *id_of_worst, worst)
               : "no marker was seen, so none could be measured");
  }

  void Depth() {
    const auto found = scene_.calibration.find("depth_scale");
    if (found == scene_.calibration.end()) return;
    const double off = 100 * (found->second - 1);
    AtMost("depth_scale", off, 100 * limits_.max_depth_share, "%", "",
           fmt::format("the sensor's depth is off by {:+.1f} %: let it warm up, check again, then "
                       "have it calibrated",
                       off));
  }

  const Scene& scene_;
  const std::optional<MarkerBaseline>& baseline_;
  const MarkerCheckLimits& limits_;
  MarkerMap seen_;
  MarkerCheck check_;
};

}  // namespace

MarkerBaseline BaselineOf(const Scene& scene, const MarkerCheckLimits& limits) {
  MarkerBaseline baseline{{}, scene.marker_dictionary, scene.marker_length_m};
  for (const auto& [id, marker] : scene.markers) {
    const bool finite = std::all_of(marker.corners.begin(), marker.corners.end(),
                                    [](const Eigen::Vector3d& p) { return p.allFinite(); });
    if (finite && marker.num_views >= limits.min_views) baseline.markers.emplace(id, marker);
  }
  return baseline;
}

MarkerCheck CheckMarkers(const Scene& scene, const std::optional<MarkerBaseline>& baseline,
                         const MarkerCheckLimits& limits) {
  return Checker(scene, baseline, limits).Run();
}

}  // namespace plumb
