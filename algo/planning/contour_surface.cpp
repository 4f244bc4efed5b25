// SPDX-License-Identifier: Apache-2.0
#include "algo/planning/contour_surface.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>

#include "algo/base/polygon.hpp"
#include "algo/base/statistics.hpp"

namespace plumb {
namespace {

constexpr double kSamePlace_m = 0.01 * kMillimetre;
constexpr double kSameHeight_m = 1e-6;
constexpr double kBesideCut_m = 15 * kMillimetre;
// Outlines of a body and its arms have far fewer; at these limits the surface still takes seconds
// and megabytes.
constexpr std::size_t kMostSlices = 10'000, kMostParts = 500, kMostCrossings = 50;
constexpr double kNowhere = std::numeric_limits<double>::quiet_NaN();

double Lowest(const FlatContour& contour) {
  double low = std::numeric_limits<double>::max();
  for (const Eigen::Vector2d& p : contour) low = std::min(low, p.y());
  return low;
}

double Highest(const FlatContour& contour) {
  double high = std::numeric_limits<double>::lowest();
  for (const Eigen::Vector2d& p : contour) high = std::max(high, p.y());
  return high;
}

// Whether two contours enclose the same, wherever they begin and whichever way they run. A contour
// passes its first point once, at a keyhole twice: one that stays there is not compared for ever.
bool IsSame(const FlatContour& a, const FlatContour& b) {
  if (a.size() != b.size() || a.empty()) return false;
  const auto near = [](const Eigen::Vector2d& p, const Eigen::Vector2d& q) {
    return (p - q).cwiseAbs().maxCoeff() < kSamePlace_m;
  };
  const std::size_t n = a.size();
  std::size_t left = 4 * n;
  for (std::size_t start = 0; start < n; ++start) {
    if (!near(a[0], b[start])) continue;
    bool forwards = true, backwards = true;
    for (std::size_t i = 1; i < n && (forwards || backwards); ++i) {
      if (left-- == 0) return false;
      forwards = forwards && near(a[i], b[(start + i) % n]);
      backwards = backwards && near(a[i], b[(start + n - i) % n]);
    }
    if (forwards || backwards) return true;
  }
  return false;
}

// Without crumbs; the largest contour first.
void DropCrumbs(std::vector<ContourSlice>& slices, const ContourSurfaceOptions& options,
                ContourSurface& result) {
  for (ContourSlice& slice : slices) {
    result.crumbs += std::erase_if(slice.contours, [&](const FlatContour& contour) {
      return contour.size() < 3 || AreaOf(contour) < options.min_area_m2;
    });
    if (slice.contours.size() > kMostParts) throw RaggedContours("too many parts in a slice");
    std::stable_sort(slice.contours.begin(), slice.contours.end(),
                     [](const auto& a, const auto& b) { return AreaOf(a) > AreaOf(b); });
    // The same contour twice would be a hole in itself.
    for (auto one = slice.contours.begin(); one != slice.contours.end(); ++one) {
      const auto same = [&](const FlatContour& other) { return IsSame(*one, other); };
      const auto rest = std::remove_if(std::next(one), slice.contours.end(), same);
      result.repeated += static_cast<std::size_t>(slice.contours.end() - rest);
      slice.contours.erase(rest, slice.contours.end());
    }
  }
  std::erase_if(slices, [](const ContourSlice& slice) { return slice.contours.empty(); });
  if (slices.size() < 3)
    throw std::invalid_argument("a surface needs contours in at least three slices");
}

// The underside of the trunk, which lies on the couch. Head and legs may lie on something higher.
double SupportUnder(const std::vector<ContourSlice>& slices) {
  constexpr double kTrunk = 0.3, kQuantile = 0.1;
  double largest = 0.0;
  for (const ContourSlice& slice : slices)
    largest = std::max(largest, AreaOf(slice.contours.front()));
  std::vector<double> lowest;
  for (const ContourSlice& slice : slices) {
    if (AreaOf(slice.contours.front()) >= kTrunk * largest)
      lowest.push_back(Lowest(slice.contours.front()));
  }
  return TakeQuantile(lowest, kQuantile);
}

// Tells holes, parts apart and parts of the couch from each other; the last ones go.
void SortParts(std::vector<ContourSlice>& slices, const ContourSurfaceOptions& options,
               ContourSurface& result) {
  for (ContourSlice& slice : slices) {
    std::vector<FlatContour> kept;
    for (FlatContour& contour : slice.contours) {
      const bool is_hole = std::any_of(kept.begin(), kept.end(), [&](const FlatContour& larger) {
        return InsidePolygon(larger, contour.front().x(), contour.front().y());
      });
      if (is_hole) {
        ++result.holes;
      } else if (!kept.empty()) {
        if (Highest(contour) < result.support_m + options.above_support_m) {
          ++result.couch_parts;
          continue;
        }
        ++result.parts_apart;
      }
      kept.push_back(std::move(contour));
    }
    slice.contours = std::move(kept);
  }
}

std::vector<double> StepsOf(const std::vector<ContourSlice>& slices) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < slices.size(); ++i)
    steps.push_back(slices[i].y_m - slices[i - 1].y_m);
  return steps;
}

GridShape GridOver(const std::vector<ContourSlice>& slices, double step) {
  double x_low = std::numeric_limits<double>::max(), x_high = -x_low;
  for (const ContourSlice& slice : slices) {
    for (const FlatContour& contour : slice.contours) {
      for (const Eigen::Vector2d& p : contour) {
        x_low = std::min(x_low, p.x());
        x_high = std::max(x_high, p.x());
      }
    }
  }
  GridShape grid;
  grid.step = step;
  grid.x_min = std::floor(x_low / step) * step;
  grid.y_min = std::floor(slices.front().y_m / step) * step;
  grid.width = static_cast<int>(std::ceil((x_high - grid.x_min) / step)) + 1;
  grid.height = static_cast<int>(std::ceil((slices.back().y_m - grid.y_min) / step)) + 1;
  return grid;
}

// Heights of the crossings of every column's centre with the contours of a slice.
std::vector<std::vector<double>> Crossings(const ContourSlice& slice, const GridShape& grid) {
  std::vector<std::vector<double>> crossings(static_cast<std::size_t>(grid.width));
  std::size_t left = kMostCrossings * crossings.size();
  for (const FlatContour& contour : slice.contours) {
    for (std::size_t i = 0, j = contour.size() - 1; i < contour.size(); j = i++) {
      const Eigen::Vector2d &a = contour[i], &b = contour[j];
      const double low = std::min(a.x(), b.x()), high = std::max(a.x(), b.x());
      int column = std::max(0, static_cast<int>((low - grid.x_min) / grid.step - 0.5));
      for (; column < grid.width && grid.x_centre(column) <= high; ++column) {
        const double x = grid.x_centre(column);
        if ((a.x() > x) == (b.x() > x)) continue;
        if (left-- == 0) throw RaggedContours("too many crossings with the columns of a slice");
        crossings[static_cast<std::size_t>(column)].push_back(
            a.y() + (b.y() - a.y()) * (x - a.x()) / (b.x() - a.x()));
      }
    }
  }
  return crossings;
}

// The top of the body in each column. An edge that is drawn there and back, as keyholes are, has no
// inside.
std::vector<double> Tops(const ContourSlice& slice, const GridShape& grid) {
  std::vector<double> tops;
  for (std::vector<double>& heights : Crossings(slice, grid)) {
    std::sort(heights.begin(), heights.end(), std::greater<>());
    std::size_t i = 0;
    while (i + 1 < heights.size() && heights[i] - heights[i + 1] < kSameHeight_m) i += 2;
    tops.push_back(i + 1 < heights.size() ? heights[i] : kNowhere);
  }
  return tops;
}

// The same without what lies beside the cuts of the slice.
std::vector<double> UncutTops(const ContourSlice& slice, const ContourSurfaceOptions& options,
                              ContourSurface& result) {
  const GridShape& grid = result.heights.grid;
  const double lowest = result.support_m + options.above_support_m;
  std::vector<double> tops = Tops(slice, grid);
  bool is_cut = false;
  for (const Eigen::Vector2d& cut : slice.cuts) {
    int column = std::max(0, static_cast<int>((cut.x() - kBesideCut_m - grid.x_min) / grid.step));
    for (; column < grid.width && grid.x_centre(column) < cut.x() + kBesideCut_m; ++column) {
      double& top = tops[static_cast<std::size_t>(column)];
      if (!(std::abs(top - cut.y()) < kBesideCut_m)) continue;
      is_cut = is_cut || top > lowest;
      top = kNowhere;
    }
  }
  result.cut_slices += is_cut ? 1 : 0;
  return tops;
}

void FillRows(const std::vector<ContourSlice>& slices, const std::vector<bool>& is_gap,
              const ContourSurfaceOptions& options, ContourSurface& result) {
  HeightMap& map = result.heights;
  std::vector<double> before, after = UncutTops(slices[1], options, result);
  // The first and the last slice take no part.
  for (std::size_t i = 1; i + 2 < slices.size(); ++i) {
    before = std::move(after);
    after = UncutTops(slices[i + 1], options, result);
    const double y = slices[i].y_m, gap = slices[i + 1].y_m - y;
    if (is_gap[i]) continue;
    for (int row = 0; row < map.grid.height; ++row) {
      const double share = (map.grid.y_centre(row) - y) / gap;
      if (!(share >= 0 && share < 1)) continue;
      for (int column = 0; column < map.grid.width; ++column) {
        const auto c = static_cast<std::size_t>(column);
        map.at(row, column) = static_cast<float>((1 - share) * before[c] + share * after[c]);
      }
    }
  }
}

// Neighbours that differ too much, and what is as low as the couch.
void MaskUnsure(const ContourSurfaceOptions& options, ContourSurface& result) {
  HeightMap& map = result.heights;
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  const auto lowest = static_cast<float>(result.support_m + options.above_support_m);
  for (float& z : map.z)
    if (z < lowest) z = kNone;
  const auto most = static_cast<float>(options.max_step_m);
  std::vector<std::uint8_t> steep(map.z.size(), 0);
  const auto compare = [&](std::size_t a, std::size_t b) {
    if (std::abs(map.z[a] - map.z[b]) > most) steep[a] = steep[b] = 1;
  };
  for (int row = 0; row < map.grid.height; ++row) {
    for (int column = 0; column < map.grid.width; ++column) {
      const std::size_t here = map.grid.index(row, column);
      if (column + 1 < map.grid.width) compare(here, map.grid.index(row, column + 1));
      if (row + 1 < map.grid.height) compare(here, map.grid.index(row + 1, column));
    }
  }
  for (std::size_t i = 0; i < steep.size(); ++i)
    if (steep[i] != 0) map.z[i] = kNone;
}

// The extreme x of a slice on one side, if its contour runs straight up there.
double StraightSide(const ContourSlice& slice, double side, double height_m) {
  constexpr double kStraight_m = 0.2 * kMillimetre;
  const FlatContour& contour = slice.contours.front();
  double farthest = std::numeric_limits<double>::lowest();
  for (const Eigen::Vector2d& p : contour) farthest = std::max(farthest, side * p.x());
  // Runs of neighbours that are as far out, from the end of one on.
  const auto is_out = [&](const Eigen::Vector2d& p) {
    return side * p.x() >= farthest - kStraight_m;
  };
  const auto begin = std::find_if_not(contour.begin(), contour.end(), is_out) - contour.begin();
  double low = std::numeric_limits<double>::max(), high = std::numeric_limits<double>::lowest();
  for (std::size_t k = 0; k < contour.size(); ++k) {
    const Eigen::Vector2d& p = contour[(static_cast<std::size_t>(begin) + k) % contour.size()];
    if (!is_out(p)) {
      low = std::numeric_limits<double>::max();
      high = std::numeric_limits<double>::lowest();
      continue;
    }
    low = std::min(low, p.y());
    high = std::max(high, p.y());
    if (high - low >= height_m) return side * farthest;
  }
  return kNowhere;
}

// Where arms or shoulders are cut, the contour ends in the air.
void MaskCutSides(const std::vector<ContourSlice>& slices, const ContourSurfaceOptions& options,
                  ContourSurface& result) {
  constexpr std::size_t kFewestSlices = 3;
  HeightMap& map = result.heights;
  for (const double side : {-1.0, 1.0}) {
    std::vector<std::pair<double, double>> cuts;  // y, x
    for (const ContourSlice& slice : slices) {
      const double x = StraightSide(slice, side, options.straight_side_m);
      if (std::isfinite(x)) cuts.emplace_back(slice.y_m, x);
    }
    if (cuts.size() < kFewestSlices) continue;
    result.cut_at_side = true;
    for (int row = 0; row < map.grid.height; ++row) {
      const double y = map.grid.y_centre(row);
      for (const auto& [cut_y, cut_x] : cuts) {
        if (std::abs(cut_y - y) > result.spacing_m) continue;
        for (int column = 0; column < map.grid.width; ++column) {
          if (std::abs(map.grid.x_centre(column) - cut_x) < kBesideCut_m)
            map.at(row, column) = std::numeric_limits<float>::quiet_NaN();
        }
      }
    }
  }
}

}  // namespace

FlatContour InPlane(const std::vector<Eigen::Vector3d>& points) {
  FlatContour flat;
  flat.reserve(points.size());
  for (const Eigen::Vector3d& p : points) flat.emplace_back(p.x(), p.y());
  return flat;
}

double AreaOf(const FlatContour& contour) {
  double twice = 0.0;
  for (std::size_t i = 0, j = contour.size() - 1; i < contour.size(); j = i++)
    twice += contour[j].x() * contour[i].y() - contour[i].x() * contour[j].y();
  return std::abs(0.5 * twice);
}

std::vector<ContourSlice> Joined(std::vector<ContourSlice> slices) {
  std::stable_sort(slices.begin(), slices.end(),
                   [](const auto& a, const auto& b) { return a.y_m < b.y_m; });
  std::vector<ContourSlice> joined;
  for (ContourSlice& slice : slices) {
    if (joined.empty() || slice.y_m - joined.back().y_m > kSamePlace_m) {
      joined.push_back(std::move(slice));
      continue;
    }
    ContourSlice& into = joined.back();
    std::ranges::move(slice.contours, std::back_inserter(into.contours));
    std::ranges::copy(slice.cuts, std::back_inserter(into.cuts));
  }
  return joined;
}

std::vector<bool> MissingWithin(const std::vector<double>& steps) {
  constexpr double kMost = 1.5;
  constexpr std::size_t kLongestRun = 3;
  std::vector<bool> missing(steps.size(), false);
  for (std::size_t from = 0; from < steps.size(); ++from) {
    double shortest = steps[from];
    for (std::size_t end = from + 1; end <= std::min(from + kLongestRun, steps.size()); ++end) {
      shortest = std::min(shortest, steps[end - 1]);
      const bool is_at_end = from == 0 || end == steps.size();
      // Several steps at the end of a scan are its other spacing.
      if (is_at_end && (end - from > 1 || steps.size() == 1)) continue;
      const double beside =
          std::max(from > 0 ? steps[from - 1] : 0.0, end < steps.size() ? steps[end] : 0.0);
      if (shortest > kMost * beside)
        std::fill(missing.begin() + static_cast<std::ptrdiff_t>(from),
                  missing.begin() + static_cast<std::ptrdiff_t>(end), true);
    }
  }
  return missing;
}

ContourSurface SurfaceFromAbove(std::vector<ContourSlice> slices,
                                const ContourSurfaceOptions& options) {
  ContourSurface result;
  slices = Joined(std::move(slices));
  DropCrumbs(slices, options, result);
  if (slices.size() > kMostSlices) throw RaggedContours("too many slices");
  std::vector<double> steps = StepsOf(slices);
  std::vector<bool> is_gap = MissingWithin(steps);
  for (std::size_t i = 0; i < steps.size(); ++i)
    if (steps[i] > options.max_spacing_m) is_gap[i] = true;
  result.gaps = static_cast<std::size_t>(std::ranges::count(is_gap, true));
  result.spacing_m = TakeQuantile(steps, 0.5);
  result.support_m = SupportUnder(slices);
  SortParts(slices, options, result);
  result.heights = HeightMap(GridOver(slices, options.step_m));
  FillRows(slices, is_gap, options, result);
  MaskUnsure(options, result);
  MaskCutSides(slices, options, result);
  return result;
}

}  // namespace plumb
