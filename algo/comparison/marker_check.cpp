// SPDX-License-Identifier: Apache-2.0
#include "algo/comparison/marker_check.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "algo/comparison/scene_alignment.hpp"
#include "algo/geometry/rigid_fit.hpp"
#include "words/check.hpp"

namespace plumb {
namespace {

constexpr double kAssumed_percent = 1e-3;
constexpr double kNotKnown = std::numeric_limits<double>::quiet_NaN();

// Size of the second map relative to the first, from the spread of the shared centres about their
// mean.
double ScaleOf(const std::vector<std::pair<const SceneMarker*, const SceneMarker*>>& shared) {
  if (shared.size() < 2) return kNotKnown;
  Eigen::Vector3d before = Eigen::Vector3d::Zero(), now = Eigen::Vector3d::Zero();
  for (const auto& [a, b] : shared) before += CentreOf(a->corners), now += CentreOf(b->corners);
  before /= static_cast<double>(shared.size()), now /= static_cast<double>(shared.size());
  double spread_before = 0.0, spread_now = 0.0;
  for (const auto& [a, b] : shared) {
    spread_before += (CentreOf(a->corners) - before).squaredNorm();
    spread_now += (CentreOf(b->corners) - now).squaredNorm();
  }
  return spread_before > 0 ? std::sqrt(spread_now / spread_before) : kNotKnown;
}

// How far a marker lies from where the others place it.
struct Displacement {
  double centre_m = 0.0, corners_m = 0.0;
  double turn_rad = 0.0;
};

Displacement DisplacementOf(const MarkerCorners& known, const Pose& T_known_seen,
                            const MarkerCorners& seen) {
  const RigidFit own = FitRigid(known, seen);
  return {.centre_m = (T_known_seen * CentreOf(seen) - CentreOf(known)).norm(),
          .corners_m = CornerDistance(known, T_known_seen, seen),
          .turn_rad = own.valid ? RotationAngle(T_known_seen.inverse() * own.T_a_b) : 0.0};
}

std::int64_t CountOf(const std::vector<std::int64_t>& ids) {
  return static_cast<std::int64_t>(ids.size());
}

/// As many of `count` as the share demands at least.
std::size_t ShareOf(std::size_t count, double share) {
  constexpr double kRounding = 1e-9;  // 0.8 of 5 are 4
  return static_cast<std::size_t>(std::ceil(share * static_cast<double>(count) - kRounding));
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
      check_.reasons.push_back(say::check::NoBaseline());
    }
    return std::move(check_);
  }

 private:
  void Fail(Message reason) { check_.reasons.push_back(std::move(reason)); }

  void AtMost(const char* name, double value, double limit, const char* unit, Message note,
              const Message& reason) {
    const bool passed = std::abs(value) <= limit;
    check_.items.push_back({name, value, limit, unit, passed, std::move(note)});
    if (!passed) Fail(reason);
  }

  void Seen() {
    std::vector<std::int64_t> missing;
    if (baseline_) {
      for (const auto& [id, marker] : baseline_->markers) {
        if (!seen_.contains(id)) missing.push_back(id);
      }
    }
    const auto found = baseline_ ? baseline_->markers.size() - missing.size() : seen_.size();
    const auto wanted = baseline_ ? ShareOf(baseline_->markers.size(), limits_.min_seen_share)
                                  : static_cast<std::size_t>(limits_.min_markers);
    const std::optional<int> reference = scene_.room_markers.reference;
    const bool has_reference = !reference || seen_.contains(*reference);
    check_.items.push_back({"markers_seen", static_cast<double>(found), static_cast<double>(wanted),
                            "", found >= wanted && has_reference,
                            missing.empty() ? Message() : say::check::Missing(missing)});
    if (!has_reference) Fail(say::check::ReferenceNotSeen(*reference));
    if (found >= wanted) {
      if (!missing.empty())
        check_.cautions.push_back(say::check::NotChecked(CountOf(missing), missing));
      return;
    }
    Fail(missing.empty() ? say::check::FewSeen(static_cast<std::int64_t>(found),
                                               static_cast<std::int64_t>(wanted))
                         : say::check::NotSeen(CountOf(missing), missing));
  }

  bool SameMarkers() {
    if (baseline_->room_markers.dictionary == scene_.room_markers.dictionary &&
        std::abs(baseline_->room_markers.length_m - scene_.room_markers.length_m) < 1e-6)
      return true;
    Fail(say::check::OtherMarkers(baseline_->room_markers.dictionary,
                                  baseline_->room_markers.length_m, scene_.room_markers.dictionary,
                                  scene_.room_markers.length_m));
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
      for (Message& reason : RefusalsOfMarkers(outcome.markers, limits_.min_markers)) {
        Fail(std::move(reason));
      }
      return;
    }
    const std::vector<int>& agreeing = outcome.alignment->markers_used;
    std::vector<std::pair<const SceneMarker*, const SceneMarker*>> good;
    for (const int id : agreeing) good.emplace_back(&baseline_->markers.at(id), &seen_.at(id));
    const double misfit_mm = outcome.alignment->rms_m / kMillimetre;
    AtMost("misfit", misfit_mm, limits_.max_misfit_m / kMillimetre, "mm", {},
           say::check::Misfit(misfit_mm, limits_.max_misfit_m / kMillimetre));
    Moved(*outcome.alignment);
    const double scale = 100 * (ScaleOf(good) - 1);
    AtMost("scale", scale, 100 * limits_.max_scale_error, "%", {}, say::check::Scale(scale));
  }

  // By the corners: the centre of a marker that was stuck on again upside down has not moved.
  void Moved(const Alignment& alignment) {
    Displacement most;
    std::optional<int> worst;  // The alignment used at least one of them.
    for (const auto& [id, marker] : seen_) {
      const auto known = baseline_->markers.find(id);
      if (known == baseline_->markers.end()) continue;
      const Pose T = FitWithout(id, alignment.markers_used).value_or(alignment.T_reference_current);
      const Displacement off = DisplacementOf(known->second.corners, T, marker.corners);
      if (!worst || off.corners_m > most.corners_m) most = off, worst = id;
    }
    const double moved_mm = most.corners_m / kMillimetre;
    const bool is_turned =
        most.corners_m > limits_.max_moved_m && most.centre_m <= limits_.max_moved_m;
    const Message turned = say::check::Turned(worst.value(), most.turn_rad / kDegree);
    AtMost("moved", moved_mm, limits_.max_moved_m / kMillimetre, "mm",
           is_turned ? turned : say::check::Marker(*worst),
           is_turned ? turned : say::check::Moved(*worst, moved_mm));
  }

  void Sides() {
    double worst = kNotKnown;
    std::optional<int> id_of_worst;
    for (const auto& [id, marker] : seen_) {
      const double off = 100 * (MeanSide(marker.corners) / scene_.room_markers.length_m - 1);
      if (!id_of_worst || std::abs(off) > std::abs(worst)) worst = off, id_of_worst = id;
    }
    // Preset `best` assumes that every marker has its nominal size, so that its sides were not
    // measured and cannot be checked.
    if (std::abs(worst) < kAssumed_percent) return;
    AtMost("side", worst, 100 * limits_.max_side_error, "%",
           id_of_worst ? say::check::Marker(*id_of_worst) : Message(),
           id_of_worst ? say::check::Side(*id_of_worst, worst) : say::check::NoneSeen());
  }

  void Depth() {
    // A scale that was not measured must not pass for a good one.
    const auto found = scene_.calibration.find("depth_scale");
    const bool is_known = found != scene_.calibration.end() && std::isfinite(found->second);
    const double off = is_known ? 100 * (found->second - 1) : kNotKnown;
    AtMost("depth_scale", off, 100 * limits_.max_depth_error, "%", {},
           is_known ? say::check::Depth(off) : say::check::DepthUnknown());
  }

  const Scene& scene_;
  const std::optional<MarkerBaseline>& baseline_;
  const MarkerCheckLimits& limits_;
  MarkerMap seen_;
  MarkerCheck check_;
};

}  // namespace

MarkerBaseline BaselineOf(const Scene& scene, const MarkerCheckLimits& limits) {
  MarkerBaseline baseline{{}, scene.room_markers};
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

std::vector<Message> ChangesOfBaseline(const MarkerBaseline& baseline,
                                       const MarkerBaseline& wanted) {
  constexpr double kShown_m = 1 * kMillimetre;
  constexpr double kShownTurned_m = 2 * kMillimetre;  // a corner is known less well than a centre
  std::vector<Message> changes;
  std::vector<std::int64_t> gone, added;
  for (const auto& [id, marker] : baseline.markers)
    if (!wanted.markers.contains(id)) gone.push_back(id);
  for (const auto& [id, marker] : wanted.markers)
    if (!baseline.markers.contains(id)) added.push_back(id);
  if (!gone.empty()) changes.push_back(say::check::BaselineGone(CountOf(gone), gone));
  if (!added.empty()) changes.push_back(say::check::BaselineNew(CountOf(added), added));
  const AlignmentOutcome outcome = AlignScenes(baseline.markers, wanted.markers, Preset::kBest, {},
                                               MarkerCheckLimits{}.min_markers);
  if (!outcome.alignment) {
    changes.push_back(say::check::BaselineNotComparable());
    return changes;
  }
  for (const auto& [id, marker] : wanted.markers) {
    const auto known = baseline.markers.find(id);
    if (known == baseline.markers.end()) continue;
    const Displacement off = DisplacementOf(known->second.corners,
                                            outcome.alignment->T_reference_current, marker.corners);
    if (off.centre_m >= kShown_m)
      changes.push_back(say::check::BaselineMoved(id, off.centre_m / kMillimetre));
    else if (off.corners_m >= kShownTurned_m)
      changes.push_back(say::check::Turned(id, off.turn_rad / kDegree));
  }
  if (changes.empty()) changes.push_back(say::check::BaselineSame());
  return changes;
}

}  // namespace plumb
