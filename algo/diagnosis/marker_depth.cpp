// SPDX-License-Identifier: Apache-2.0
#include "algo/diagnosis/marker_depth.hpp"

#include <cmath>
#include <map>
#include <optional>

#include <opencv2/calib3d.hpp>

#include "algo/base/statistics.hpp"
#include "algo/geometry/working_image.hpp"

namespace plumb {
namespace {

constexpr int kSamplesPerSide = 7;
constexpr double kFace = 0.8;  // Fraction of the side that is sampled: edges mix two surfaces.

// Views of all markers together, of which the scatter is judged.
constexpr std::size_t kViewsForLayout = 12;
// Mean deviation of the ratios where nothing is wrong: below 1 %. Turning or mirroring the depth
// image must reduce it to this part, which no other fault lets it do.
constexpr double kDisagrees = 0.02, kMuchBetter = 0.25;

float DepthAt(const cv::Mat& depth_m, int row, int column, DepthLayout layout) {
  const bool across = layout == DepthLayout::kMirrored || layout == DepthLayout::kTurned;
  const bool down = layout == DepthLayout::kUpsideDown || layout == DepthLayout::kTurned;
  return depth_m.at<float>(down ? depth_m.rows - 1 - row : row,
                           across ? depth_m.cols - 1 - column : column);
}

// Depth over expected depth, median over the face; nothing without a pose or enough depth.
std::optional<double> RatioOnFace(const MarkerObservation& marker, const cv::Mat& depth_m,
                                  DepthLayout layout, const Intrinsics& intrinsics,
                                  const CalibrationModel& known, double length_m) {
  std::vector<cv::Point2d> ideal;
  for (const Eigen::Vector2d& corner : marker.corners) {
    const Eigen::Vector2d xy = Undistort(intrinsics, corner);
    ideal.emplace_back(xy.x(), xy.y());
  }
  std::vector<cv::Point3d> square;
  for (const Eigen::Vector3d& corner : CornersInMarkerFrame(length_m))
    square.emplace_back(corner.x(), corner.y(), corner.z());
  cv::Vec3d turn, place;
  if (!cv::solvePnP(square, ideal, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), turn, place, false,
                    cv::SOLVEPNP_IPPE_SQUARE))
    return std::nullopt;
  cv::Matx33d rotation;
  cv::Rodrigues(turn, rotation);
  std::vector<double> ratios;
  for (int i = 0; i < kSamplesPerSide; ++i) {
    for (int j = 0; j < kSamplesPerSide; ++j) {
      const auto at = [&](int k) {
        return kFace * length_m * (static_cast<double>(k) / (kSamplesPerSide - 1) - 0.5);
      };
      const cv::Vec3d p = rotation * cv::Vec3d(at(i), at(j), 0) + place;
      if (!(p[2] > 0)) return std::nullopt;
      const Eigen::Vector2d pixel = Project(intrinsics, {p[0], p[1], p[2]});
      const Eigen::Vector2d in_depth = InDepthImage(pixel, intrinsics, depth_m);
      const auto column = static_cast<int>(std::lround(in_depth.x()));
      const auto row = static_cast<int>(std::lround(in_depth.y()));
      if (column < 0 || row < 0 || column >= depth_m.cols || row >= depth_m.rows) continue;
      if (const float z = DepthAt(depth_m, row, column, layout); z > 0)
        ratios.push_back(
            known.CorrectedDepth(
                z, CentredCoordinates(pixel.x(), pixel.y(), intrinsics.width, intrinsics.height)) /
            p[2]);
    }
  }
  if (2 * ratios.size() < std::size_t{kSamplesPerSide} * kSamplesPerSide) return std::nullopt;
  return TakeMedian(ratios);
}

// By marker.
std::map<int, std::vector<double>> RatiosOf(const TrackingMap& map, DepthLayout layout,
                                            const Intrinsics& intrinsics,
                                            const CalibrationModel& known, double length_m) {
  std::map<int, std::vector<double>> ratios;
  for (const MapKeyframe& keyframe : map.keyframes) {
    if (keyframe.data.view.depth_m.empty()) continue;
    for (const MarkerObservation& marker : keyframe.data.markers)
      if (const auto ratio =
              RatioOnFace(marker, keyframe.data.view.depth_m, layout, intrinsics, known, length_m))
        ratios[marker.id].push_back(*ratio);
  }
  return ratios;
}

// Mean relative deviation of all views' ratios from their median. The mean, because with the depth
// image upside down four of five markers on a flat floor still agree.
std::optional<double> DeviationOf(const std::map<int, std::vector<double>>& ratios) {
  std::vector<double> all;
  for (const auto& [id, values] : ratios) all.insert(all.end(), values.begin(), values.end());
  if (all.size() < kViewsForLayout) return std::nullopt;
  const double median = TakeMedian(all);
  double sum = 0.0;
  for (const double value : all) sum += std::abs(value / median - 1);
  return sum / static_cast<double>(all.size());
}

}  // namespace

std::optional<double> DepthRatioOnFace(const MarkerObservation& marker, const cv::Mat& depth_m,
                                       const Intrinsics& intrinsics, double length_m) {
  return RatioOnFace(marker, depth_m, DepthLayout::kAsStated, intrinsics, CalibrationModel{},
                     length_m);
}

DepthLayout FindDepthLayout(const TrackingMap& map, const Intrinsics& intrinsics,
                            const CalibrationModel& known, double length_m) {
  const auto deviation_of = [&](DepthLayout layout) {
    return DeviationOf(RatiosOf(map, layout, intrinsics, known, length_m));
  };
  const std::optional<double> stated = deviation_of(DepthLayout::kAsStated);
  if (!stated || *stated < kDisagrees) return DepthLayout::kAsStated;
  DepthLayout best = DepthLayout::kAsStated;
  double least = kMuchBetter * *stated;
  for (const DepthLayout layout :
       {DepthLayout::kMirrored, DepthLayout::kUpsideDown, DepthLayout::kTurned}) {
    const std::optional<double> deviation = deviation_of(layout);
    if (!deviation || *deviation >= least) continue;
    best = layout;
    least = *deviation;
  }
  return best;
}

std::vector<MarkerDepth> MeasureMarkerDepths(const TrackingMap& map, const Intrinsics& intrinsics,
                                             const CalibrationModel& known, double length_m) {
  std::map<int, std::vector<double>> ratios =
      RatiosOf(map, DepthLayout::kAsStated, intrinsics, known, length_m);
  std::vector<MarkerDepth> measured;
  for (auto& [id, values] : ratios) {
    MarkerDepth marker{.id = id, .num_views = static_cast<int>(values.size())};
    marker.ratio = TakeMedian(values);
    for (double& value : values) value = std::abs(value - marker.ratio);
    marker.scatter = kMadToSigma * TakeMedian(values);
    measured.push_back(marker);
  }
  return measured;
}

}  // namespace plumb
