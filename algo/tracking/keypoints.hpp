// SPDX-License-Identifier: Apache-2.0
// Natural keypoints: detection, tracking and recognition.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"

namespace plumb {

/// Image pyramid for KLT in OpenCV's layout.
using Pyramid = std::vector<cv::Mat>;

struct KeypointOptions {
  /// At 640 pixels image width; at most one corner per cell, so that corners spread over the image.
  int cell_px = 32;
  int window_px = 15;  ///< KLT window.
  int levels = 3;      ///< KLT pyramid levels above the base.
  /// Minimum of the smaller eigenvalue of the structure tensor, (grey levels per pixel)^2.
  double min_quality = 4.0;
};

/// Cell for fewer keypoints: of twice the area.
inline constexpr int kFewerCell_px = 45;

[[nodiscard]] Pyramid MakePyramid(const cv::Mat& gray, const KeypointOptions& options);

/// New corners (Shi-Tomasi, sub-pixel by the peak of the score) in cells that contain none of
/// `occupied`, the best first in each cell.
[[nodiscard]] std::vector<Eigen::Vector2f> DetectCorners(
    const cv::Mat& gray, const std::vector<Eigen::Vector2f>& occupied,
    const KeypointOptions& options);

/// Indices of the points that are the first in their cell of an image of this size, in their order.
/// Points outside the image are left out.
[[nodiscard]] std::vector<std::size_t> FirstOfCells(const std::vector<Eigen::Vector2f>& points,
                                                    int width, int height,
                                                    const KeypointOptions& options);

/// Brightness of an image relative to another at the same places: the median over the points of the
/// ratio of the mean grey levels around them, or 1 with too few points. Automatic exposure changes
/// it.
[[nodiscard]] double BrightnessRatio(const cv::Mat& from, const cv::Mat& to,
                                     const std::vector<Eigen::Vector2f>& points,
                                     const std::vector<Eigen::Vector2f>& guesses);

/// Tracks points from one image to another; `found[i]` is false where the patch was lost or looks
/// different.
struct KltResult {
  std::vector<Eigen::Vector2f> points;
  std::vector<bool> found;
};
[[nodiscard]] KltResult TrackKlt(const Pyramid& from, const Pyramid& to,
                                 const std::vector<Eigen::Vector2f>& points,
                                 const std::vector<Eigen::Vector2f>& guesses, int max_level,
                                 const KeypointOptions& options);

/// Depth at a pixel: the median of its 3x3 neighbours; 0 at edges and holes.
[[nodiscard]] double DepthAt(const cv::Mat& depth_m, const Eigen::Vector2d& pixel);

/// Depth at a pixel with the slope of the plane around it.
struct SurfaceDepth {
  double z_m = 0.0;
  /// Slope of the inverse depth, which is linear in the pixel on a plane: 1/m per pixel right and
  /// down.
  Eigen::Vector2d inverse_slope = Eigen::Vector2d::Zero();
};
/// The same for measurements: the depth of the plane through the 5x5 neighbours, and 0 also where
/// the surface around them is not a plane, because a track whose window covers an edge follows
/// neither side. The slope is that of the plane through all 13x13 pixels, which must agree with it.
[[nodiscard]] SurfaceDepth SurfaceDepthAt(const cv::Mat& depth_m, const Eigen::Vector2d& pixel);

/// ORB features with depth, for relocalisation.
struct DescribedFeatures {
  std::vector<Eigen::Vector2f> pixels;
  std::vector<Eigen::Vector3f> in_camera;  ///< Metres.
  cv::Mat descriptors;                     ///< CV_8UC1, 32 columns, one row per feature.
};
/// @param gray        CV_8UC1, of the size that `intrinsics` state.
/// @param depth_m     CV_32FC1, metres, of that size or at working resolution.
/// @return What has depth, in the camera's frame.
[[nodiscard]] DescribedFeatures DescribeFeatures(const cv::Mat& gray, const cv::Mat& depth_m,
                                                 const Intrinsics& intrinsics);

}  // namespace plumb
