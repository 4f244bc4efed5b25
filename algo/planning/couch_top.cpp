// SPDX-License-Identifier: Apache-2.0
#include "algo/planning/couch_top.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "algo/base/statistics.hpp"

namespace plumb {
namespace {

// The outermost 4 cm of a slice are examined, without the first centimetre, which may be rounded.
// Over the other 3 cm the flank of a body rises by more than 1 cm.
constexpr double kEdge_m = 10 * kMillimetre, kBin_m = 6 * kMillimetre;
constexpr std::size_t kBins = 5;
constexpr double kLevel_m = 3 * kMillimetre;
constexpr double kLeastShare = 1.0 / 3.0;  // of the slices, on one side or both
constexpr double kMostSag_m = 5 * kMillimetre;
// Of a body above what it lies on, at half of the places.
constexpr double kLeastAbove_m = 20 * kMillimetre;

using SlicePoints = std::vector<Eigen::Vector2d>;

// Height of the outermost part on one side, if it is level.
std::optional<double> LevelSide(const SlicePoints& points, double side) {
  double farthest = std::numeric_limits<double>::lowest();
  for (const Eigen::Vector2d& p : points) farthest = std::max(farthest, side * p.x());
  std::array<double, kBins> tops;
  tops.fill(-std::numeric_limits<double>::infinity());
  for (const Eigen::Vector2d& p : points) {
    const double bin = (farthest - side * p.x() - kEdge_m) / kBin_m;
    if (!(bin >= 0 && bin < static_cast<double>(kBins))) continue;
    double& top = tops[static_cast<std::size_t>(bin)];
    top = std::max(top, p.y());
  }
  const auto [low, high] = std::ranges::minmax(tops);
  // A part narrower than the first centimetre fills no bin.
  if (!std::isfinite(low) || !(high - low <= kLevel_m)) return std::nullopt;
  return 0.5 * (low + high);
}

SlicePoints PointsOf(const ContourSlice& slice) {
  SlicePoints points;
  for (const FlatContour& contour : slice.contours)
    points.insert(points.end(), contour.begin(), contour.end());
  return points;
}

double TopOf(const ContourSlice& slice) {
  double top = std::numeric_limits<double>::lowest();
  for (const Eigen::Vector2d& p : PointsOf(slice)) top = std::max(top, p.y());
  return top;
}

// Height of a structure whose top is at one height along the scan; nothing for another one.
std::optional<double> FlatTop(const std::vector<ContourSlice>& structure) {
  std::vector<double> tops;
  for (const ContourSlice& slice : structure) tops.push_back(TopOf(slice));
  if (tops.empty() || TakeQuantile(tops, 0.9) - TakeQuantile(tops, 0.1) > kMostSag_m)
    return std::nullopt;
  return TakeMedian(tops);
}

// For each place of the scan whether the structure is there. It may be drawn in every second one.
std::vector<bool> PresentAt(const std::vector<ContourSlice>& scan,
                            const std::vector<ContourSlice>& structure) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < scan.size(); ++i) steps.push_back(scan[i].y_m - scan[i - 1].y_m);
  const double reach_m = steps.empty() ? 0.0 : 1.01 * TakeMedian(steps);
  std::vector<bool> present;
  for (const ContourSlice& slice : scan) {
    const auto next =
        std::ranges::lower_bound(structure, slice.y_m - reach_m, {}, &ContourSlice::y_m);
    present.push_back(next != structure.end() && next->y_m <= slice.y_m + reach_m);
  }
  return present;
}

bool IsBeneath(const std::vector<ContourSlice>& scan, const std::vector<bool>& present,
               double top_m) {
  std::size_t above = 0;
  for (std::size_t i = 0; i < scan.size(); ++i)
    above += present[i] && TopOf(scan[i]) > top_m + kLeastAbove_m ? 1 : 0;
  return 2 * above >= static_cast<std::size_t>(std::ranges::count(present, true));
}

}  // namespace

std::optional<double> CouchTop(const std::vector<ContourSlice>& scan) {
  std::vector<double> heights;
  std::size_t num_level = 0;
  for (const ContourSlice& slice : scan) {
    const SlicePoints points = PointsOf(slice);
    const std::size_t before = heights.size();
    for (const double side : {-1.0, 1.0}) {
      if (const auto height = LevelSide(points, side)) heights.push_back(*height);
    }
    num_level += heights.size() > before ? 1 : 0;
  }
  const double least = kLeastShare * static_cast<double>(scan.size());
  if (heights.empty() || static_cast<double>(num_level) < least) return std::nullopt;
  const double low = TakeQuantile(heights, 0.1), high = TakeQuantile(heights, 0.9);
  if (high - low > kMostSag_m) return std::nullopt;
  return high;
}

DrawnCouch CouchAsDrawn(const std::vector<ContourSlice>& scan,
                        const std::vector<DrawnSupport>& supports) {
  DrawnCouch couch;
  std::vector<std::vector<bool>> present;
  for (const DrawnSupport& support : supports) {
    const std::optional<double> top_m = FlatTop(support.slices);
    std::vector<bool> is_there = PresentAt(scan, support.slices);
    const auto places = static_cast<double>(std::ranges::count(is_there, true));
    if (!top_m || places < kLeastShare * static_cast<double>(scan.size()) ||
        !IsBeneath(scan, is_there, *top_m)) {
      couch.not_used.push_back(support.name);
      continue;
    }
    couch.parts.push_back({.name = support.name, .top_m = *top_m});
    present.push_back(std::move(is_there));
  }
  if (couch.parts.empty()) return couch;
  // Where none is drawn, that which is drawn along the most of the scan goes on.
  std::size_t longest = 0;
  const auto length = [&](std::size_t i) {
    return std::pair(std::ranges::count(present[i], true), couch.parts[i].top_m);
  };
  for (std::size_t i = 1; i < present.size(); ++i)
    if (length(i) > length(longest)) longest = i;
  std::vector<bool> counts(couch.parts.size(), false);
  for (std::size_t at = 0; at < scan.size(); ++at) {
    std::optional<std::size_t> highest;
    for (std::size_t i = 0; i < present.size(); ++i) {
      if (present[i][at] && (!highest || couch.parts[i].top_m > couch.parts[*highest].top_m))
        highest = i;
    }
    counts[highest.value_or(longest)] = true;
    couch.top_m.push_back(couch.parts[highest.value_or(longest)].top_m);
  }
  for (std::size_t i = counts.size(); i > 0; --i)
    if (!counts[i - 1]) couch.parts.erase(couch.parts.begin() + static_cast<std::ptrdiff_t>(i - 1));
  return couch;
}

void RemoveBelow(double height_m, ContourSlice& slice) {
  for (FlatContour& contour : slice.contours)
    for (Eigen::Vector2d& p : contour) p.y() = std::max(p.y(), height_m);
  std::erase_if(slice.contours, [](const FlatContour& contour) { return AreaOf(contour) == 0; });
}

}  // namespace plumb
