// SPDX-License-Identifier: Apache-2.0
#include "tests/unit/markers/marker_scene.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include <Eigen/LU>

namespace plumb::testing {
namespace {

constexpr int kSubsamples = 6;  // per pixel and direction

double Uniform(std::mt19937& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

/// Light from the marker's sheet at (x, y) in the marker frame; negative beside the sheet.
double SheetLight(const MarkerDictionary& dictionary, int id, double x, double y,
                  const SceneLook& look) {
  const int bits = dictionary.bits_per_side();
  const double cell = look.length_m / (bits + 2);
  const double half = look.length_m / 2;
  const double sheet = half + look.quiet_zone_cells * cell;
  if (std::abs(x) >= sheet || std::abs(y) >= sheet) return -1;
  if (std::abs(x) >= half || std::abs(y) >= half) return look.white;
  const int column = static_cast<int>((x + half) / cell) - 1;
  const int row = static_cast<int>((half - y) / cell) - 1;
  const bool white =
      row >= 0 && row < bits && column >= 0 && column < bits && dictionary.Bit(id, row, column);
  return white ? look.white : look.black;
}

/// Ideal coordinates of the places within a pixel: the lens undone at its four corners, linear
/// between them.
Eigen::Vector2d IdealWithin(const std::array<Eigen::Vector2d, 4>& corners, double x, double y) {
  return (1 - y) * ((1 - x) * corners[0] + x * corners[1]) +
         y * ((1 - x) * corners[2] + x * corners[3]);
}

/// The part of the image around a marker's sheet that blur may reach.
cv::Rect RegionOf(const PlacedMarker& marker, const Intrinsics& intrinsics, const SceneLook& look) {
  double low_x = 1e9, low_y = 1e9, high_x = -1e9, high_y = -1e9;
  for (const Eigen::Vector3d& corner :
       CornersInMarkerFrame(look.length_m * (1.1 + 0.4 * look.quiet_zone_cells))) {
    const Eigen::Vector2d p = Project(intrinsics, marker.T_camera_marker * corner);
    low_x = std::min(low_x, p.x());
    high_x = std::max(high_x, p.x());
    low_y = std::min(low_y, p.y());
    high_y = std::max(high_y, p.y());
  }
  const double reach = 4 + look.motion_px;
  const cv::Rect box(cv::Point(static_cast<int>(low_x - reach), static_cast<int>(low_y - reach)),
                     cv::Point(static_cast<int>(high_x + reach), static_cast<int>(high_y + reach)));
  return box & cv::Rect(0, 0, intrinsics.width, intrinsics.height);
}

void PaintMarker(const MarkerDictionary& dictionary, const PlacedMarker& marker,
                 const Intrinsics& intrinsics, const SceneLook& look, const cv::Rect& region,
                 cv::Mat& light) {
  const Pose T_marker_camera = marker.T_camera_marker.inverse();
  const Eigen::Vector3d eye = T_marker_camera.translation();
  for (int row = region.y; row < region.y + region.height; ++row) {
    for (int column = region.x; column < region.x + region.width; ++column) {
      std::array<Eigen::Vector2d, 4> ideal;
      for (int k = 0; k < 4; ++k) {
        ideal[static_cast<std::size_t>(k)] =
            Undistort(intrinsics, Eigen::Vector2d(column - 0.5 + k % 2, row - 0.5 + k / 2));
      }
      double sum = 0;
      for (int k = 0; k < kSubsamples * kSubsamples; ++k) {
        const Eigen::Vector2d place = IdealWithin(ideal, (k % kSubsamples + 0.5) / kSubsamples,
                                                  (k / kSubsamples + 0.5) / kSubsamples);
        const Eigen::Vector3d ray =
            T_marker_camera.linear() * Eigen::Vector3d(place.x(), place.y(), 1);
        const Eigen::Vector3d hit = eye - ray * (eye.z() / ray.z());
        const double value = SheetLight(dictionary, marker.id, hit.x(), hit.y(), look);
        sum += value < 0 ? light.at<float>(row, column) : value;
      }
      light.at<float>(row, column) = static_cast<float>(sum / (kSubsamples * kSubsamples));
    }
  }
}

void MotionBlur(double length_px, double angle_rad, cv::Mat light) {
  const int steps = 2 * static_cast<int>(std::ceil(4 * length_px)) + 1;
  cv::Mat sum = cv::Mat::zeros(light.size(), CV_32F);
  for (int k = 0; k < steps; ++k) {
    const double offset = length_px * (static_cast<double>(k) / (steps - 1) - 0.5);
    const cv::Matx23d shift(1, 0, offset * std::cos(angle_rad), 0, 1, offset * std::sin(angle_rad));
    cv::Mat moved;
    cv::warpAffine(light, moved, cv::Mat(shift), light.size(), cv::INTER_CUBIC,
                   cv::BORDER_REPLICATE);
    sum += moved;
  }
  cv::Mat(sum / steps).copyTo(light);
}

}  // namespace

cv::Mat Render(const MarkerDictionary& dictionary, const std::vector<PlacedMarker>& markers,
               const Intrinsics& intrinsics, const SceneLook& look, std::mt19937& random) {
  cv::Mat light(intrinsics.height, intrinsics.width, CV_32F, cv::Scalar(look.ground));
  for (const PlacedMarker& marker : markers) {
    const cv::Rect region = RegionOf(marker, intrinsics, look);
    if (region.empty()) continue;
    PaintMarker(dictionary, marker, intrinsics, look, region, light);
    if (look.motion_px > 0) MotionBlur(look.motion_px, look.motion_angle_rad, light(region));
  }
  if (look.blur_px > 0) cv::GaussianBlur(light, light, {}, look.blur_px);
  std::normal_distribution<double> noise(0, look.noise);
  cv::Mat image(light.size(), CV_8UC1);
  for (int row = 0; row < light.rows; ++row) {
    for (int column = 0; column < light.cols; ++column) {
      const double lit =
          std::max(0.0, light.at<float>(row, column) * (1 - look.shading * column / light.cols));
      const double encoded =
          lit <= 0.0031308 ? 12.92 * lit : 1.055 * std::pow(lit, 1 / 2.4) - 0.055;
      image.at<std::uint8_t>(row, column) =
          cv::saturate_cast<std::uint8_t>(255 * encoded + (look.noise > 0 ? noise(random) : 0.0));
    }
  }
  return image;
}

ImageCorners TrueCorners(const PlacedMarker& marker, double length_m,
                         const Intrinsics& intrinsics) {
  ImageCorners corners;
  const MarkerCorners own = CornersInMarkerFrame(length_m);
  for (std::size_t k = 0; k < 4; ++k)
    corners[k] = Project(intrinsics, marker.T_camera_marker * own[k]);
  return corners;
}

PlacedMarker RandomMarker(int id, double side_px, double max_tilt_rad, double length_m,
                          const Intrinsics& intrinsics, std::mt19937& random) {
  const double z = intrinsics.fx * length_m / side_px;
  const double reach = 1.2 * side_px;
  const Eigen::Vector2d pixel(Uniform(random, reach, intrinsics.width - reach),
                              Uniform(random, reach, intrinsics.height - reach));
  const Eigen::Vector2d ideal = Undistort(intrinsics, pixel);
  PlacedMarker marker{id};
  marker.T_camera_marker.translation() = z * Eigen::Vector3d(ideal.x(), ideal.y(), 1);
  const double tilt = Uniform(random, 0, max_tilt_rad);
  const double tilt_axis = Uniform(random, 0, 2 * std::numbers::pi);
  // Facing: y up on the print is up in the image (-y of the camera), z of the print towards the
  // camera.
  marker.T_camera_marker.linear() =
      RotationFromVector(tilt * Eigen::Vector3d(std::cos(tilt_axis), std::sin(tilt_axis), 0)) *
      RotationFromVector(Eigen::Vector3d(std::numbers::pi, 0, 0)) *
      RotationFromVector(
          Eigen::Vector3d(0, 0, Uniform(random, -std::numbers::pi, std::numbers::pi)));
  return marker;
}

}  // namespace plumb::testing
