#include "algo/markers/corner_depth.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Cholesky>

#include "algo/base/robust_weights.hpp"
#include "algo/base/statistics.hpp"

namespace plumb {
namespace {

constexpr int kMinPixels = 12;
constexpr double kMinValidShare = 0.4;
constexpr double kMinInlierShare = 0.6;
constexpr int kMaxSamples = 4000;     // enough for a plane; larger faces are thinned
constexpr int kNumRounds = 6;         // rounds of reweighting
constexpr double kTukeyScales = 4.0;  // cut-off in robust standard deviations
constexpr double kMinSigma = 5e-4;  // 1/m; half a millimetre at 1 m, below the noise of any sensor

void CheckSize(const DepthView& view, const RayTable& rays) {
  if (view.depth_m.type() != CV_32FC1 || view.depth_m.cols != rays.width() ||
      view.depth_m.rows != rays.height())
    throw std::invalid_argument(fmt::format(
        "corner depth: depth image {}x{} (type {}) does not fit a camera of {}x{}",
        view.depth_m.cols, view.depth_m.rows, view.depth_m.type(), rays.width(), rays.height()));
}

bool IsInside(const Eigen::Vector2d& pixel, const RayTable& rays) {
  return pixel.x() >= -0.5 && pixel.y() >= -0.5 && pixel.x() < rays.width() - 0.5 &&
         pixel.y() < rays.height() - 0.5;  // false for NaN
}

/// A depth pixel of the face.
struct FacePixel {
  double x, y;     ///< ideal ray
  double inverse;  ///< 1/z
};

/// Depth pixels inside a clockwise convex outline, thinned. `num_inside` counts all pixels on the
/// same raster, valid or not.
std::vector<FacePixel> PixelsInside(const ImageCorners& outline, const DepthView& view,
                                    const RayTable& rays, int& num_inside) {
  double x0 = outline[0].x(), x1 = x0, y0 = outline[0].y(), y1 = y0;
  for (const Eigen::Vector2d& corner : outline) {
    x0 = std::min(x0, corner.x());
    x1 = std::max(x1, corner.x());
    y0 = std::min(y0, corner.y());
    y1 = std::max(y1, corner.y());
  }
  const int step = std::max(1, static_cast<int>(std::sqrt((x1 - x0) * (y1 - y0) / kMaxSamples)));
  const int column_end = std::min(rays.width() - 1, static_cast<int>(x1));
  const int row_end = std::min(rays.height() - 1, static_cast<int>(y1));
  std::vector<FacePixel> pixels;
  num_inside = 0;
  for (int row = std::max(0, static_cast<int>(std::ceil(y0))); row <= row_end; row += step) {
    for (int column = std::max(0, static_cast<int>(std::ceil(x0))); column <= column_end;
         column += step) {
      bool inside = true;
      for (std::size_t k = 0; k < 4 && inside; ++k) {
        const Eigen::Vector2d& from = outline[k];
        const Eigen::Vector2d side = outline[(k + 1) % 4] - from;
        inside = side.x() * (row - from.y()) - side.y() * (column - from.x()) >= 0.0;
      }
      if (!inside) continue;
      ++num_inside;
      const float z = view.depth_m.at<float>(row, column);
      if (!(z > 0.0F && std::isfinite(z))) continue;
      const Eigen::Vector2f& ray = rays.ideal(row, column);
      pixels.push_back({ray.x(), ray.y(), 1.0 / static_cast<double>(z)});
    }
  }
  return pixels;
}

/// Corners are clockwise on the print, and so in an image with y down: every turn is to the same
/// side.
bool IsConvexClockwise(const ImageCorners& outline) {
  for (std::size_t k = 0; k < 4; ++k) {
    const Eigen::Vector2d a = outline[(k + 1) % 4] - outline[k];
    const Eigen::Vector2d b = outline[(k + 2) % 4] - outline[(k + 1) % 4];
    if (!(a.x() * b.y() - a.y() * b.x() > 1.0)) return false;  // px^2; false for NaN
  }
  return true;
}

/// Weighted least squares of 1/z = a x + b y + c about the pixels' mean; false if the rays do not
/// span a plane.
bool SolvePlane(const std::vector<FacePixel>& pixels, const std::vector<double>& weights,
                Eigen::Vector3d& plane) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  double sum = 0.0;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    mean += weights[i] * Eigen::Vector3d(pixels[i].x, pixels[i].y, pixels[i].inverse);
    sum += weights[i];
  }
  if (!(sum > 0.0)) return false;
  mean /= sum;
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const Eigen::Vector2d offset(pixels[i].x - mean.x(), pixels[i].y - mean.y());
    normal += weights[i] * offset * offset.transpose();
    right += weights[i] * (pixels[i].inverse - mean.z()) * offset;
  }
  if (!(normal.determinant() > 1e-6 * normal.trace() * normal.trace())) return false;
  const Eigen::Vector2d slope = normal.ldlt().solve(right);
  plane = {slope.x(), slope.y(), mean.z() - slope.dot(mean.head<2>())};
  return plane.allFinite();
}

double Residual(const FacePixel& pixel, const Eigen::Vector3d& plane) {
  return pixel.inverse - (plane.x() * pixel.x + plane.y() * pixel.y + plane.z());
}

}  // namespace

int DepthWindow(int window_px_at_640, int image_width) {
  if (window_px_at_640 < 1 || image_width < 1)
    throw std::invalid_argument(fmt::format("corner depth: window of {} px in an image {} wide",
                                            window_px_at_640, image_width));
  const int half =
      static_cast<int>(static_cast<double>(window_px_at_640) * image_width / 640.0 / 2.0);
  return 2 * std::max(1, half) + 1;
}

std::array<std::optional<Eigen::Vector3d>, 4> PaperCornerPositions(const MarkerObservation& marker,
                                                                   const DepthView& view,
                                                                   const RayTable& rays,
                                                                   int window_px_at_640) {
  CheckSize(view, rays);
  const int half = DepthWindow(window_px_at_640, rays.width()) / 2;
  std::array<std::optional<Eigen::Vector3d>, 4> positions;
  for (std::size_t k = 0; k < 4; ++k) {
    const Eigen::Vector2d& corner = marker.corners[k];
    if (!IsInside(corner, rays)) continue;
    const int column = static_cast<int>(std::lround(corner.x()));
    const int row = static_cast<int>(std::lround(corner.y()));
    const float at_corner = view.depth_m.at<float>(row, column);
    if (at_corner > 0.0F) {
      positions[k] =
          static_cast<double>(at_corner) * Undistort(rays.intrinsics(), corner).homogeneous();
      continue;
    }
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    int count = 0;
    for (int r = std::max(0, row - half); r <= std::min(rays.height() - 1, row + half); ++r) {
      for (int c = std::max(0, column - half); c <= std::min(rays.width() - 1, column + half);
           ++c) {
        const float z = view.depth_m.at<float>(r, c);
        if (!(z > 0.0F)) continue;
        sum += static_cast<double>(z) * rays.ideal(r, c).cast<double>().homogeneous();
        ++count;
      }
    }
    if (count > 0) positions[k] = sum / count;
  }
  return positions;
}

std::optional<MarkerFace> FitMarkerFace(const MarkerObservation& marker, const DepthView& view,
                                        const RayTable& rays) {
  CheckSize(view, rays);
  if (!IsConvexClockwise(marker.corners)) return std::nullopt;
  for (const Eigen::Vector2d& corner : marker.corners)
    if (!IsInside(corner, rays)) return std::nullopt;
  int num_inside = 0;
  const std::vector<FacePixel> pixels = PixelsInside(marker.corners, view, rays, num_inside);
  const int num_pixels = static_cast<int>(pixels.size());
  if (num_pixels < kMinPixels || num_pixels < kMinValidShare * num_inside) return std::nullopt;

  // Starts from the pixels near the median depth, so that a hand or a gap beside the marker does
  // not tilt the first plane.
  std::vector<double> values;
  values.reserve(pixels.size());
  for (const FacePixel& pixel : pixels) values.push_back(pixel.inverse);
  const double median = TakeMedian(values);
  for (std::size_t i = 0; i < pixels.size(); ++i) values[i] = std::abs(pixels[i].inverse - median);
  const double spread = TakeMedian(values);
  std::vector<double> weights(pixels.size());
  for (std::size_t i = 0; i < pixels.size(); ++i)
    weights[i] =
        std::abs(pixels[i].inverse - median) <= std::max(3.0 * spread, kMinSigma) ? 1.0 : 0.0;

  MarkerFace face;
  double sigma = kMinSigma;
  for (int round = 0; round < kNumRounds; ++round) {
    if (!SolvePlane(pixels, weights, face.plane)) return std::nullopt;
    for (std::size_t i = 0; i < pixels.size(); ++i)
      values[i] = std::abs(Residual(pixels[i], face.plane));
    sigma = std::max(kMinSigma, kMadToSigma * TakeMedian(values));
    for (std::size_t i = 0; i < pixels.size(); ++i)
      weights[i] = TukeyWeight(Residual(pixels[i], face.plane) / (kTukeyScales * sigma));
  }
  double sum_squared = 0.0;
  int num_inliers = 0;
  for (const FacePixel& pixel : pixels) {
    const double residual = Residual(pixel, face.plane);
    if (std::abs(residual) > kTukeyScales * sigma) continue;
    const double depth_error = residual / (pixel.inverse * pixel.inverse);
    sum_squared += depth_error * depth_error;
    ++num_inliers;
  }
  face.num_pixels = num_pixels;
  face.inlier_share = static_cast<double>(num_inliers) / num_pixels;
  if (face.inlier_share < kMinInlierShare) return std::nullopt;
  face.rms_m = std::sqrt(sum_squared / num_inliers);
  for (std::size_t k = 0; k < 4; ++k) {
    const Eigen::Vector3d ray = Undistort(rays.intrinsics(), marker.corners[k]).homogeneous();
    const double inverse = face.plane.dot(ray);
    if (!(inverse > 0.05)) return std::nullopt;  // behind the camera or farther than 20 m
    face.corners[k] = ray / inverse;
  }
  return face;
}

}  // namespace plumb
