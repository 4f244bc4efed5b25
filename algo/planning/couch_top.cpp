// SPDX-License-Identifier: Apache-2.0
#include "algo/planning/couch_top.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>

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

}  // namespace

std::optional<double> CouchTop(const std::vector<ContourSlice>& slices) {
  std::map<std::int64_t, SlicePoints> places;
  for (const ContourSlice& slice : slices) {
    SlicePoints& points = places[std::llround(slice.y_m * 1e5)];
    for (const FlatContour& contour : slice.contours)
      points.insert(points.end(), contour.begin(), contour.end());
  }
  std::vector<double> heights;
  std::size_t num_level = 0;
  for (const auto& [place, points] : places) {
    const std::size_t before = heights.size();
    for (const double side : {-1.0, 1.0}) {
      if (const auto height = LevelSide(points, side)) heights.push_back(*height);
    }
    num_level += heights.size() > before ? 1 : 0;
  }
  const double least = kLeastShare * static_cast<double>(places.size());
  if (heights.empty() || static_cast<double>(num_level) < least) return std::nullopt;
  const double low = TakeQuantile(heights, 0.1), high = TakeQuantile(heights, 0.9);
  if (high - low > kMostSag_m) return std::nullopt;
  return high;
}

std::optional<double> FlatTop(const std::vector<ContourSlice>& structure) {
  std::vector<double> tops;
  for (const ContourSlice& slice : structure) {
    double top = std::numeric_limits<double>::lowest();
    for (const FlatContour& contour : slice.contours)
      for (const Eigen::Vector2d& p : contour) top = std::max(top, p.y());
    tops.push_back(top);
  }
  if (tops.empty() || TakeQuantile(tops, 0.9) - TakeQuantile(tops, 0.1) > kMostSag_m)
    return std::nullopt;
  return TakeMedian(tops);
}

void RemoveBelow(double height_m, std::vector<ContourSlice>& slices) {
  for (ContourSlice& slice : slices) {
    for (FlatContour& contour : slice.contours)
      for (Eigen::Vector2d& p : contour) p.y() = std::max(p.y(), height_m);
  }
}

}  // namespace plumb
