// SPDX-License-Identifier: Apache-2.0
#include "algo/markers/marker_side.hpp"

#include <algorithm>
#include <cstddef>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "algo/markers/square_homography.hpp"

namespace plumb::marker_side {
namespace {

constexpr int kTablePerCell = 4;  // resolution of the blurred cell rows

/// Cell (row, column) counted with side `side` on top.
bool WhiteFromSide(const MarkerPattern& pattern, int side, int row, int column) {
  const int last = pattern.bits_per_side - 1;
  switch (side) {
    case 0:
      return pattern.White(row, column);
    case 1:
      return pattern.White(column, last - row);
    case 2:
      return pattern.White(last - row, last - column);
    default:
      return pattern.White(last - column, row);
  }
}

/// Darkness along the side of depth row `row` (0 is the border), blurred by a Gaussian of
/// `blur_cells`. White is wider than black by `shift_cells` at each end.
void FillDarkness(const MarkerPattern& pattern, int side, int row, double blur_cells,
                  double shift_cells, std::vector<float>& table) {
  const int cells = pattern.bits_per_side + 2;
  std::array<float, 12> dark{};  // with paper at both ends
  for (int i = 0; i < cells; ++i) {
    const bool border = row == 0 || i == 0 || i == cells - 1;
    dark[static_cast<std::size_t>(i + 1)] =
        border || !WhiteFromSide(pattern, side, row - 1, i - 1) ? 1.0F : 0.0F;
  }
  table.assign(static_cast<std::size_t>(cells * kTablePerCell + 1), 0.0F);
  for (int i = 0; i <= cells; ++i) {
    const float change = dark[static_cast<std::size_t>(i + 1)] - dark[static_cast<std::size_t>(i)];
    if (change == 0.0F) continue;
    const double edge = i + (change > 0 ? shift_cells : -shift_cells);
    const auto reach = static_cast<int>(std::ceil(4 * blur_cells * kTablePerCell));
    const int size = static_cast<int>(table.size());
    for (int k = std::max(0, i * kTablePerCell - reach); k < size; ++k) {
      const double position = static_cast<double>(k) / kTablePerCell;
      table[static_cast<std::size_t>(k)] +=
          change * Normal().At(static_cast<float>((position - edge) / blur_cells)).first;
    }
  }
}

float Lookup(const std::vector<float>& table, float cells) {
  const float position =
      std::clamp(cells * kTablePerCell, 0.0F, static_cast<float>(table.size() - 1) - 1e-3F);
  const auto index = static_cast<std::size_t>(position);
  const float part = position - static_cast<float>(index);
  return table[index] + part * (table[index + 1] - table[index]);
}

/// Deflection by the lens of the straight segment a..b at its middle, along `normal`.
double Bow(const Intrinsics& intrinsics, const Eigen::Vector2d& a, const Eigen::Vector2d& b,
           const Eigen::Vector2d& normal) {
  const Eigen::Vector2d middle = 0.5 * (Undistort(intrinsics, a) + Undistort(intrinsics, b));
  return normal.dot(Project(intrinsics, middle.homogeneous()) - 0.5 * (a + b));
}

}  // namespace

std::optional<Side> MakeSide(const ImageCorners& corners, int index, const MarkerPattern& pattern,
                             double blur_along_px, double edge_shift_px,
                             const std::optional<Intrinsics>& intrinsics) {
  const auto at = [&](int k) -> const Eigen::Vector2d& {
    return corners[static_cast<std::size_t>((index + k) % 4)];
  };
  const int cells = pattern.bits_per_side + 2;
  Side side;
  side.origin = at(0);
  side.direction = at(1) - at(0);
  side.length_px = side.direction.norm();
  if (!(side.length_px > 4)) return std::nullopt;
  side.direction /= side.length_px;
  side.normal = Eigen::Vector2d(-side.direction.y(), side.direction.x());

  const std::optional<Eigen::Matrix3d> cells_to_pixel =
      SquareToQuad(cells, {at(0), at(1), at(2), at(3)});
  if (!cells_to_pixel) return std::nullopt;
  side.pixel_to_cells = cells_to_pixel->inverse();
  const auto depth_of = [&](double column, double row) {
    return side.normal.dot((*cells_to_pixel * Eigen::Vector3d(column, row, 1)).hnormalized() -
                           side.origin);
  };
  side.depth_one = {depth_of(0, 1), depth_of(cells, 1)};
  side.depth_two = {depth_of(0, 2), depth_of(cells, 2)};
  side.cell_px = 0.5 * (side.depth_one[0] + side.depth_one[1]);
  if (!(side.depth_one[0] > 0.5 && side.depth_one[1] > 0.5)) return std::nullopt;
  // Less than a whole cell outside, because sheets are often cut close to the square.
  side.outside_px = std::clamp(0.6 * side.cell_px, 1.5, 8.0);
  side.inside_px = std::clamp(1.25 * side.cell_px, 2.5, 8.0);
  if (intrinsics) side.bow_px = Bow(*intrinsics, at(0), at(1), side.normal);

  const double blur_cells = std::max(blur_along_px, kMinBlur_px) * cells / side.length_px;
  for (int row = 0; row < 3; ++row)
    FillDarkness(pattern, index, row, blur_cells, edge_shift_px * cells / side.length_px,
                 side.darkness[static_cast<std::size_t>(row)]);
  return side;
}

void CollectSamples(const cv::Mat& gray, const Tone& tone, const Side& side, int wanted,
                    std::vector<Sample>& samples) {
  samples.clear();
  const double margin_px = std::max(1.0, 0.06 * side.length_px);
  const bool by_column = std::abs(side.direction.x()) >= std::abs(side.direction.y());
  const int major = by_column ? 0 : 1;
  const int minor = 1 - major;
  const double slope = side.direction[minor] / side.direction[major];
  const double per_line = (side.outside_px + side.inside_px) / std::abs(side.normal[minor]);

  const double first = side.origin[major] + margin_px * side.direction[major];
  const double last = side.origin[major] + (side.length_px - margin_px) * side.direction[major];
  const int begin = static_cast<int>(std::ceil(std::min(first, last)));
  const int end = static_cast<int>(std::floor(std::max(first, last)));
  const int stride = std::max(1, static_cast<int>((end - begin + 1) * per_line / wanted));
  const int major_limit = by_column ? gray.cols : gray.rows;
  const int minor_limit = by_column ? gray.rows : gray.cols;
  const double sign = side.normal[minor] > 0 ? 1 : -1;
  for (int line = std::max(begin, 0); line <= std::min(end, major_limit - 1); line += stride) {
    const double on_side = side.origin[minor] + slope * (line - side.origin[major]);
    const double from = on_side - sign * side.outside_px / std::abs(side.normal[minor]);
    const double to = on_side + sign * side.inside_px / std::abs(side.normal[minor]);
    const int low = std::max(static_cast<int>(std::ceil(std::min(from, to))), 0);
    const int high = std::min(static_cast<int>(std::floor(std::max(from, to))), minor_limit - 1);
    for (int k = low; k <= high; ++k) {
      const int x = by_column ? line : k;
      const int y = by_column ? k : line;
      const Eigen::Vector2d offset = Eigen::Vector2d(x, y) - side.origin;
      const double along = side.direction.dot(offset) / side.length_px;
      const Eigen::Vector3d cell = side.pixel_to_cells * Eigen::Vector3d(x, y, 1);
      if (!(cell.z() > 0)) continue;  // beyond the plane's horizon: not a square seen by a camera
      const auto column = static_cast<float>(cell.x() / cell.z());
      samples.push_back(
          {static_cast<float>(side.normal.dot(offset) - 4 * side.bow_px * along * (1 - along)),
           static_cast<float>(along),
           tone.light[gray.ptr<std::uint8_t>(y)[x]],
           tone.levels_per_light[gray.ptr<std::uint8_t>(y)[x]],
           {Lookup(side.darkness[0], column), Lookup(side.darkness[1], column),
            Lookup(side.darkness[2], column)}});
    }
  }
}

}  // namespace plumb::marker_side
