// SPDX-License-Identifier: Apache-2.0
#include "algo/markers/quad_finder.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include <Eigen/Core>

namespace plumb {
namespace {

using Outline = std::vector<cv::Point>;

constexpr double kOutlineToEdge_px = 0.5;

Eigen::Vector2d ToVector(const cv::Point& p) { return {p.x, p.y}; }

/// Indices of the four vertices of an outline in its own order, or nothing if it has another number
/// of vertices.
std::optional<std::array<std::size_t, 4>> FourVertices(const Outline& outline,
                                                       double tolerance_px) {
  std::vector<cv::Point> vertices;
  cv::approxPolyDP(outline, vertices, tolerance_px, true);
  if (vertices.size() != 4 || !cv::isContourConvex(vertices)) return std::nullopt;
  std::array<std::size_t, 4> indices{};
  for (std::size_t k = 0; k < 4; ++k) {
    const auto found = std::find(outline.begin(), outline.end(), vertices[k]);
    if (found == outline.end()) return std::nullopt;
    indices[k] = static_cast<std::size_t>(found - outline.begin());
  }
  return indices;
}

/// Total least squares line n . p = c through the middle part of the outline between two vertices.
struct OutlineLine {
  Eigen::Vector2d normal;
  double offset = 0;
};

std::optional<OutlineLine> FitSide(const Outline& outline, std::size_t from, std::size_t to) {
  const std::size_t count = (to + outline.size() - from) % outline.size();
  const std::size_t skip = std::max<std::size_t>(1, count / 8);  // excludes the rounded corners
  if (count < 2 * skip + 4) return std::nullopt;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  const double n = static_cast<double>(count - 2 * skip + 1);
  const Eigen::Vector2d base = ToVector(outline[from]);
  for (std::size_t k = skip; k <= count - skip; ++k) {
    const Eigen::Vector2d p = ToVector(outline[(from + k) % outline.size()]) - base;
    sum += p;
    squares += p * p.transpose();
  }
  const Eigen::Vector2d mean = sum / n;
  const Eigen::Matrix2d scatter = squares / n - mean * mean.transpose();
  const double angle = 0.5 * std::atan2(2 * scatter(0, 1), scatter(0, 0) - scatter(1, 1));
  const Eigen::Vector2d normal(-std::sin(angle), std::cos(angle));
  return OutlineLine{normal, normal.dot(base + mean)};
}

/// True for the outer outline of a dark region, false for the rim of a hole in one; OpenCV traces
/// them in opposite directions.
bool IsOuter(const Outline& outline, const std::array<std::size_t, 4>& vertices) {
  double area = 0;  // positive: clockwise as seen
  for (std::size_t k = 0; k < 4; ++k) {
    const Eigen::Vector2d a = ToVector(outline[vertices[k]]);
    const Eigen::Vector2d b = ToVector(outline[vertices[(k + 1) % 4]]);
    area += a.x() * b.y() - b.x() * a.y();
  }
  return area < 0;
}

/// Corners from lines along the four sections of the outline, clockwise as seen.
std::optional<ImageCorners> FitQuad(const Outline& outline, std::array<std::size_t, 4> vertices) {
  // approxPolyDP keeps the outline's direction, so vertices k and k+1 bound one section.
  const Eigen::Vector2d centre =
      0.25 * (ToVector(outline[vertices[0]]) + ToVector(outline[vertices[1]]) +
              ToVector(outline[vertices[2]]) + ToVector(outline[vertices[3]]));
  std::array<OutlineLine, 4> lines;
  for (std::size_t k = 0; k < 4; ++k) {
    const std::optional<OutlineLine> line = FitSide(outline, vertices[k], vertices[(k + 1) % 4]);
    if (!line) return std::nullopt;
    // Outline pixels are the last dark ones; the edge is half a pixel outside them.
    const double outside =
        line->normal.dot(centre) < line->offset ? kOutlineToEdge_px : -kOutlineToEdge_px;
    lines[k] = {line->normal, line->offset + outside};
  }
  ImageCorners corners;
  for (std::size_t k = 0; k < 4; ++k) {
    const OutlineLine& before = lines[(k + 3) % 4];
    const OutlineLine& after = lines[k];
    const double determinant =
        before.normal.x() * after.normal.y() - before.normal.y() * after.normal.x();
    const Eigen::Vector2d vertex = ToVector(outline[vertices[k]]);
    corners[k] = vertex;
    if (std::abs(determinant) > 0.1) {
      const Eigen::Vector2d meet(
          (before.offset * after.normal.y() - after.offset * before.normal.y()) / determinant,
          (before.normal.x() * after.offset - after.normal.x() * before.offset) / determinant);
      if ((meet - vertex).norm() < 6) corners[k] = meet;
    }
  }
  std::swap(corners[1], corners[3]);  // the outline was counter-clockwise
  return corners;
}

bool Plausible(const ImageCorners& corners, const cv::Size& size,
               const QuadFinderOptions& options) {
  double sum = 0;
  double shortest = 1e9;
  for (std::size_t k = 0; k < 4; ++k) {
    const Eigen::Vector2d& p = corners[k];
    if (!(p.x() >= options.border_px && p.y() >= options.border_px &&
          p.x() <= size.width - 1 - options.border_px &&
          p.y() <= size.height - 1 - options.border_px)) {
      return false;
    }
    const double side = (corners[(k + 1) % 4] - p).norm();
    sum += side;
    shortest = std::min(shortest, side);
  }
  return sum / 4 >= options.min_side_px && shortest >= 0.5 * options.min_side_px;
}

}  // namespace

std::vector<ImageCorners> FindDarkQuads(const cv::Mat& gray, const cv::Rect& part,
                                        const QuadFinderOptions& options) {
  cv::Mat dark;
  cv::adaptiveThreshold(gray(part), dark, 255, cv::ADAPTIVE_THRESH_MEAN_C, cv::THRESH_BINARY_INV,
                        options.window_px, options.min_darkness);
  std::vector<Outline> outlines;
  cv::findContours(dark, outlines, cv::RETR_LIST, cv::CHAIN_APPROX_NONE, part.tl());

  std::vector<ImageCorners> quads;
  // The shortest outline of a square seen at a slant: two sides in diagonal steps of the image.
  const auto min_points = static_cast<std::size_t>(2.4 * options.min_side_px);
  for (const Outline& outline : outlines) {
    if (outline.size() < min_points) continue;
    const auto points = static_cast<double>(outline.size());
    const cv::Rect box = cv::boundingRect(outline);
    if (std::max(box.width, box.height) < 0.7 * options.min_side_px ||
        points > 4.5 * (box.width + box.height))
      continue;
    const std::optional<std::array<std::size_t, 4>> vertices =
        FourVertices(outline, std::max(1.5, 0.03 * points));
    if (!vertices || !IsOuter(outline, *vertices)) continue;
    const std::optional<ImageCorners> corners = FitQuad(outline, *vertices);
    if (corners && Plausible(*corners, gray.size(), options)) quads.push_back(*corners);
  }
  return quads;
}

}  // namespace plumb
