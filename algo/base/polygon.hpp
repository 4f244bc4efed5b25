// SPDX-License-Identifier: Apache-2.0
// Polygons: those that people draw, contours of slices, outlines of markers.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <utility>

#include <Eigen/Core>

namespace plumb {

/// The first two edges of a closed polygon that cross each other, each by the index of the corner
/// where it begins; nothing if none do. Edges that only touch do not cross. Such a polygon has no
/// inside that a person would agree with.
[[nodiscard]] inline std::optional<std::pair<std::size_t, std::size_t>> CrossingEdges(
    std::span<const Eigen::Vector2d> corners) {
  const std::size_t n = corners.size();
  const auto side = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                       const Eigen::Vector2d& p) {
    const Eigen::Vector2d u = b - a, v = p - a;
    return u.x() * v.y() - u.y() * v.x();
  };
  const auto opposite = [](double one, double other) {
    return (one > 0 && other < 0) || (one < 0 && other > 0);
  };
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector2d &a = corners[i], &b = corners[(i + 1) % n];
    for (std::size_t j = i + 2; j < n; ++j) {
      if (i == 0 && j == n - 1) continue;  // Neighbours, across the end of the list.
      const Eigen::Vector2d &c = corners[j], &d = corners[(j + 1) % n];
      if (opposite(side(a, b, c), side(a, b, d)) && opposite(side(c, d, a), side(c, d, b)))
        return std::pair(i, j);
    }
  }
  return std::nullopt;
}

/// By the even-odd rule. Points on an edge are on either side of it.
[[nodiscard]] inline bool InsidePolygon(std::span<const Eigen::Vector2d> corners, double x,
                                        double y) {
  bool inside = false;
  for (std::size_t i = 0, j = corners.size() - 1; i < corners.size(); j = i++) {
    const Eigen::Vector2d &a = corners[i], &b = corners[j];
    if ((a.y() > y) != (b.y() > y) && x < (b.x() - a.x()) * (y - a.y()) / (b.y() - a.y()) + a.x())
      inside = !inside;
  }
  return inside;
}

}  // namespace plumb
