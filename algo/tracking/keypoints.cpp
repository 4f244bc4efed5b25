// SPDX-License-Identifier: Apache-2.0
#include "algo/tracking/keypoints.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include <Eigen/Geometry>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "algo/base/statistics.hpp"
#include "algo/geometry/working_image.hpp"

namespace plumb {
namespace {

std::vector<cv::Point2f> ToCv(const std::vector<Eigen::Vector2f>& points) {
  std::vector<cv::Point2f> result;
  result.reserve(points.size());
  for (const Eigen::Vector2f& p : points) result.emplace_back(p.x(), p.y());
  return result;
}

// Offset of the peak of a parabola through three samples, in [-0.5, 0.5].
float PeakOffset(float before, float at, float after) {
  const float curvature = before - 2 * at + after;
  return curvature < 0 ? std::clamp(0.5F * (before - after) / curvature, -0.5F, 0.5F) : 0.0F;
}

// The best corner in each cell of a run of cells in a row, if it is good enough.
void AddBestOfCells(const cv::Mat& gray, const cv::Rect& run, int cell,
                    const KeypointOptions& options, std::vector<Eigen::Vector2f>& corners) {
  constexpr int kBlock = 5;
  // Margin in pixels around a pixel for its score and its neighbours' scores.
  constexpr int kAround = kBlock / 2 + 2;
  const cv::Rect seen(run.x - kAround, run.y - kAround, run.width + 2 * kAround,
                      run.height + 2 * kAround);
  cv::Mat score;
  cv::cornerMinEigenVal(gray(seen), score, kBlock, 3);
  // The score sums, over its 5x5 block, squares of Sobel gradients (8 times the gradient) scaled by
  // 1 / (255 * 4 * 5).
  const auto threshold = static_cast<float>(options.min_quality * 25.0 * 64.0 / (5100.0 * 5100.0));
  const auto at = [&](int y, int x) { return score.at<float>(y - seen.y, x - seen.x); };
  for (int first = run.x; first < run.br().x;) {
    const int end = std::min((first / cell + 1) * cell, run.br().x);
    float best = threshold;
    std::optional<cv::Point> peak;
    for (int y = run.y; y < run.br().y; ++y) {
      for (int x = first; x < end; ++x) {
        if (at(y, x) > best) {
          best = at(y, x);
          peak.emplace(x, y);
        }
      }
    }
    first = end;
    if (!peak) continue;
    const auto [x, y] = std::pair(peak->x, peak->y);
    corners.emplace_back(static_cast<float>(x) + PeakOffset(at(y, x - 1), best, at(y, x + 1)),
                         static_cast<float>(y) + PeakOffset(at(y - 1, x), best, at(y + 1, x)));
  }
}

// Division of an image into cells; remembers which of them contain a point.
class Cells {
 public:
  Cells(int width, int height, const KeypointOptions& options)
      : size(std::max(8, options.cell_px * width / 640)),
        columns((width + size - 1) / size),
        rows((height + size - 1) / size),
        taken_(static_cast<std::size_t>(columns * rows), false) {}

  const int size, columns, rows;

  [[nodiscard]] bool IsTaken(int row, int column) const { return taken_[Index(row, column)]; }
  /// True if the point is in the image, and its cell contained none before.
  bool Take(const Eigen::Vector2f& p) {
    const int c = static_cast<int>(p.x()) / size;
    const int r = static_cast<int>(p.y()) / size;
    if (c < 0 || r < 0 || c >= columns || r >= rows || taken_[Index(r, c)]) return false;
    taken_[Index(r, c)] = true;
    return true;
  }

 private:
  [[nodiscard]] std::size_t Index(int row, int column) const {
    return static_cast<std::size_t>(row * columns + column);
  }
  std::vector<bool> taken_;
};

}  // namespace

Pyramid MakePyramid(const cv::Mat& gray, const KeypointOptions& options) {
  Pyramid pyramid;
  cv::buildOpticalFlowPyramid(gray, pyramid, cv::Size(options.window_px, options.window_px),
                              options.levels, true);
  return pyramid;
}

std::vector<Eigen::Vector2f> DetectCorners(const cv::Mat& gray,
                                           const std::vector<Eigen::Vector2f>& occupied,
                                           const KeypointOptions& options) {
  Cells cells(gray.cols, gray.rows, options);
  for (const Eigen::Vector2f& p : occupied) cells.Take(p);
  const int cell = cells.size;
  constexpr int kMargin = 8;
  const cv::Rect inner(kMargin, kMargin, gray.cols - 2 * kMargin, gray.rows - 2 * kMargin);
  std::vector<Eigen::Vector2f> corners;
  for (int r = 0; r < cells.rows; ++r) {
    for (int c = 0; c < cells.columns; ++c) {
      if (cells.IsTaken(r, c)) continue;
      int end = c + 1;
      while (end < cells.columns && !cells.IsTaken(r, end)) ++end;
      const cv::Rect run = cv::Rect(c * cell, r * cell, (end - c) * cell, cell) & inner;
      if (!run.empty()) AddBestOfCells(gray, run, cell, options, corners);
      c = end;
    }
  }
  return corners;
}

std::vector<std::size_t> FirstOfCells(const std::vector<Eigen::Vector2f>& points, int width,
                                      int height, const KeypointOptions& options) {
  Cells cells(width, height, options);
  std::vector<std::size_t> first;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (cells.Take(points[i])) first.push_back(i);
  return first;
}

double BrightnessRatio(const cv::Mat& from, const cv::Mat& to,
                       const std::vector<Eigen::Vector2f>& points,
                       const std::vector<Eigen::Vector2f>& guesses) {
  constexpr int kReach = 3;
  constexpr std::size_t kFewest = 8;
  const auto sum = [](const cv::Mat& image, const Eigen::Vector2f& p) {
    const int x = static_cast<int>(std::lround(p.x()));
    const int y = static_cast<int>(std::lround(p.y()));
    if (x < kReach || y < kReach || x + kReach >= image.cols || y + kReach >= image.rows) return 0;
    int total = 0;
    for (int r = y - kReach; r <= y + kReach; ++r) {
      const auto* line = image.ptr<std::uint8_t>(r);
      for (int c = x - kReach; c <= x + kReach; ++c) total += line[c];
    }
    return total;
  };
  std::vector<double> ratios;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const int before = sum(from, points[i]);
    const int after = sum(to, guesses[i]);
    if (before > 0 && after > 0) ratios.push_back(static_cast<double>(after) / before);
  }
  return ratios.size() < kFewest ? 1.0 : TakeMedian(ratios);
}

KltResult TrackKlt(const Pyramid& from, const Pyramid& to,
                   const std::vector<Eigen::Vector2f>& points,
                   const std::vector<Eigen::Vector2f>& guesses, int max_level,
                   const KeypointOptions& options) {
  KltResult result;
  result.points = guesses;
  result.found.assign(points.size(), false);
  if (points.empty()) return result;
  const std::vector<cv::Point2f> start = ToCv(points);
  std::vector<cv::Point2f> end = ToCv(guesses);
  std::vector<unsigned char> status;
  std::vector<float> error;
  cv::calcOpticalFlowPyrLK(
      from, to, start, end, status, error, cv::Size(options.window_px, options.window_px),
      max_level, cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 20, 0.01),
      cv::OPTFLOW_USE_INITIAL_FLOW, 1e-3);
  const float width = static_cast<float>(to[0].cols);
  const float height = static_cast<float>(to[0].rows);
  for (std::size_t i = 0; i < points.size(); ++i) {
    result.points[i] = {end[i].x, end[i].y};
    // The error is the mean absolute difference of the patches in grey levels.
    result.found[i] = status[i] != 0 && error[i] < 20.0F && end[i].x > 3 && end[i].y > 3 &&
                      end[i].x < width - 4 && end[i].y < height - 4;
  }
  return result;
}

double DepthAt(const cv::Mat& depth_m, const Eigen::Vector2d& pixel) {
  const int x = static_cast<int>(std::lround(pixel.x()));
  const int y = static_cast<int>(std::lround(pixel.y()));
  if (x < 1 || y < 1 || x + 1 >= depth_m.cols || y + 1 >= depth_m.rows) return 0.0;
  std::array<float, 9> values{};
  int n = 0;
  for (int r = y - 1; r <= y + 1; ++r)
    for (int c = x - 1; c <= x + 1; ++c)
      if (const float z = depth_m.at<float>(r, c); z > 0) values[static_cast<std::size_t>(n++)] = z;
  if (n < 6) return 0.0;
  std::sort(values.begin(), values.begin() + n);
  if (values[static_cast<std::size_t>(n - 1)] - values[0] > 0.03F * values[0] + 0.005F) return 0.0;
  return values[static_cast<std::size_t>(n / 2)];
}

SurfaceDepth SurfaceDepthAt(const cv::Mat& depth_m, const Eigen::Vector2d& pixel) {
  constexpr int kReach = 2;  // Half-width in pixels of the window for the plane fit.
  // Half-width in which the depth must lie on the plane; most of a track's window.
  constexpr int kEdgeReach = 6;
  // Tolerance of inverse depth for relief and one part of the noise,
  constexpr double kTolerance = 0.01;
  constexpr double kTolerancePerM = 0.005;  // which grows with depth.
  const int x = static_cast<int>(std::lround(pixel.x()));
  const int y = static_cast<int>(std::lround(pixel.y()));
  if (x < kEdgeReach || y < kEdgeReach || x + kEdgeReach >= depth_m.cols ||
      y + kEdgeReach >= depth_m.rows)
    return {};
  // Inverse depth is linear in the pixel on a plane.
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  int n = 0;
  for (int r = y - kReach; r <= y + kReach; ++r) {
    for (int c = x - kReach; c <= x + kReach; ++c) {
      const float z = depth_m.at<float>(r, c);
      if (!(z > 0)) continue;
      const Eigen::Vector3d row(1.0, c - pixel.x(), r - pixel.y());
      H += row * row.transpose();
      g += row / z;
      ++n;
    }
  }
  constexpr int kWindow = (2 * kReach + 1) * (2 * kReach + 1);
  if (3 * n < 2 * kWindow) return {};
  const Eigen::Vector3d plane = H.ldlt().solve(g);
  if (!(plane[0] > 0)) return {};
  H.setZero();
  g.setZero();
  for (int r = y - kEdgeReach; r <= y + kEdgeReach; r += 2) {
    for (int c = x - kEdgeReach; c <= x + kEdgeReach; c += 2) {
      const float z = depth_m.at<float>(r, c);
      if (!(z > 0)) continue;
      const Eigen::Vector3d row(1.0, c - pixel.x(), r - pixel.y());
      if (std::abs(plane.dot(row) * z - 1.0) > kTolerance + kTolerancePerM * z) return {};
      H += row * row.transpose();
      g += row / z;
    }
  }
  return {1.0 / plane[0], H.ldlt().solve(g).tail<2>()};
}

DescribedFeatures DescribeFeatures(const cv::Mat& gray, const cv::Mat& depth_m,
                                   const Intrinsics& intrinsics) {
  // Few levels: relocalisation sees the same body from about the same distance.
  const cv::Ptr<cv::ORB> orb =
      cv::ORB::create(500, 1.3F, 4, 15, 0, 2, cv::ORB::HARRIS_SCORE, 31, 10);
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
  orb->detectAndCompute(gray, cv::noArray(), keypoints, descriptors);
  DescribedFeatures features;
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const Eigen::Vector2d pixel(keypoints[i].pt.x, keypoints[i].pt.y);
    const double z = DepthAt(depth_m, InDepthImage(pixel, intrinsics, depth_m));
    if (z <= 0) continue;
    const Eigen::Vector2d ideal = Undistort(intrinsics, pixel);
    features.pixels.emplace_back(pixel.cast<float>());
    features.in_camera.emplace_back(Eigen::Vector3d(z * ideal.x(), z * ideal.y(), z).cast<float>());
    features.descriptors.push_back(descriptors.row(static_cast<int>(i)));
  }
  return features;
}

}  // namespace plumb
