// SPDX-License-Identifier: Apache-2.0
#include "algo/markers/marker_decoder.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "algo/markers/square_homography.hpp"

namespace plumb {
namespace {

constexpr int kMaxCells = 10;            // 8 x 8 bits and the border
constexpr double kMinContrast = 12;      // grey levels between black and white cells
constexpr double kMaxWrongBorder = 0.1;  // fraction of border cells that may look white

/// The code after one quarter turn clockwise of the print.
std::uint64_t TurnedClockwise(std::uint64_t code, int side) {
  std::uint64_t turned = 0;
  for (int row = 0; row < side; ++row) {
    for (int column = 0; column < side; ++column) {
      const int from = (side - 1 - column) * side + row;
      turned = (turned << 1) | ((code >> (side * side - 1 - from)) & 1U);
    }
  }
  return turned;
}

/// Bilinear interpolation; the position must be at least a pixel inside the image.
double ValueAt(const cv::Mat& gray, double x, double y) {
  const int x0 = static_cast<int>(x);
  const int y0 = static_cast<int>(y);
  const double fx = x - x0;
  const double fy = y - y0;
  const std::uint8_t* upper = gray.ptr<std::uint8_t>(y0) + x0;
  const std::uint8_t* lower = gray.ptr<std::uint8_t>(y0 + 1) + x0;
  return (1 - fy) * ((1 - fx) * upper[0] + fx * upper[1]) +
         fy * ((1 - fx) * lower[0] + fx * lower[1]);
}

/// Mean grey value at every cell's middle, row-major. False if the square leaves the image.
bool SampleCells(const cv::Mat& gray, const Eigen::Matrix3d& cells_to_pixel, int cells,
                 std::array<float, kMaxCells * kMaxCells>& values) {
  constexpr std::array<double, 2> kPlaces[] = {
      {0.35, 0.35}, {0.65, 0.35}, {0.35, 0.65}, {0.65, 0.65}};
  for (int row = 0; row < cells; ++row) {
    for (int column = 0; column < cells; ++column) {
      double sum = 0;
      for (const auto& place : kPlaces) {
        const Eigen::Vector3d p =
            cells_to_pixel * Eigen::Vector3d(column + place[0], row + place[1], 1);
        const double x = p.x() / p.z();
        const double y = p.y() / p.z();
        if (!(x >= 0 && y >= 0 && x < gray.cols - 1 && y < gray.rows - 1)) return false;
        sum += ValueAt(gray, x, y);
      }
      values[static_cast<std::size_t>(row * cells + column)] = static_cast<float>(sum / 4);
    }
  }
  return true;
}

/// Otsu's threshold between two groups of values; nothing if they are too close.
std::optional<float> Threshold(const float* values, int count) {
  std::array<float, kMaxCells * kMaxCells> sorted{};
  std::copy(values, values + count, sorted.begin());
  std::sort(sorted.begin(), sorted.begin() + count);
  double total = 0;
  for (int i = 0; i < count; ++i) total += sorted[static_cast<std::size_t>(i)];
  double below = 0;
  double best = -1;
  double best_gap = 0;
  float threshold = 0;
  for (int i = 1; i < count; ++i) {
    below += sorted[static_cast<std::size_t>(i - 1)];
    const double gap = (total - below) / (count - i) - below / i;
    const double between = gap * gap * i * (count - i);
    if (between > best) {
      best = between;
      best_gap = gap;
      threshold =
          0.5F * (sorted[static_cast<std::size_t>(i - 1)] + sorted[static_cast<std::size_t>(i)]);
    }
  }
  if (best_gap < kMinContrast) return std::nullopt;
  return threshold;
}

}  // namespace

MarkerDecoder::MarkerDecoder(const MarkerDictionary& dictionary, int max_wrong_bits)
    : bits_per_side_(dictionary.bits_per_side()), max_wrong_bits_(max_wrong_bits) {
  for (int id = 0; id < dictionary.size(); ++id) {
    std::uint64_t code = dictionary.Code(id);
    for (int turns = 0; turns < 4; ++turns) {
      codes_.push_back({code, id, turns});
      code = TurnedClockwise(code, bits_per_side_);
    }
  }
}

std::optional<DecodedMarker> MarkerDecoder::Decode(const cv::Mat& gray,
                                                   const ImageCorners& corners) const {
  const int cells = bits_per_side_ + 2;
  const std::optional<Eigen::Matrix3d> cells_to_pixel = SquareToQuad(cells, corners);
  if (!cells_to_pixel) return std::nullopt;
  std::array<float, kMaxCells * kMaxCells> values{};
  if (!SampleCells(gray, *cells_to_pixel, cells, values)) return std::nullopt;
  const std::optional<float> threshold = Threshold(values.data(), cells * cells);
  if (!threshold) return std::nullopt;

  int wrong_border = 0;
  std::uint64_t code = 0;
  for (int row = 0; row < cells; ++row) {
    for (int column = 0; column < cells; ++column) {
      const bool white = values[static_cast<std::size_t>(row * cells + column)] > *threshold;
      if (row == 0 || column == 0 || row == cells - 1 || column == cells - 1) {
        wrong_border += white ? 1 : 0;
      } else {
        code = (code << 1) | (white ? 1U : 0U);
      }
    }
  }
  if (wrong_border > kMaxWrongBorder * 4 * (cells - 1)) return std::nullopt;

  const Rotated* best = nullptr;
  int best_distance = max_wrong_bits_ + 1;
  for (const Rotated& candidate : codes_) {
    const int distance = std::popcount(candidate.code ^ code);
    if (distance < best_distance) {
      best = &candidate;
      best_distance = distance;
    }
  }
  if (best == nullptr) return std::nullopt;
  DecodedMarker marker;
  marker.id = best->id;
  marker.wrong_bits = best_distance;
  // A print turned clockwise k times has its top-left corner k places later, clockwise.
  for (std::size_t k = 0; k < 4; ++k)
    marker.corners[k] = corners[(k + static_cast<std::size_t>(best->turns)) % 4];
  return marker;
}

}  // namespace plumb
