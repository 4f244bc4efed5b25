// SPDX-License-Identifier: Apache-2.0
// The resolution at which surfaces are made: about 320 columns for any sensor.
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "algo/base/intrinsics.hpp"
#include "algo/sensor_model/depth_noise.hpp"

namespace plumb {

/// Side of the blocks of pixels that one working pixel stands for.
/// @throws std::invalid_argument if the image is smaller than one block.
[[nodiscard]] int WorkingBlock(const Intrinsics& image);

/// The camera of the working images for images of this camera.
/// @throws std::invalid_argument as WorkingBlock().
[[nodiscard]] Intrinsics WorkingIntrinsics(const Intrinsics& image);

/// Step along the optical axis, in metres, between neighbouring working pixels that is too large
/// for any plausible surface.
/// @param depth_m    The nearer depth.
/// @param pixel_rad  Angle between two working pixels.
[[nodiscard]] float EdgeStep_m(const DepthNoise& noise, float depth_m, float pixel_rad);

/// Working image of depth: of each block the inverse of the mean INVERSE depth, because planes are
/// linear in it (so that the mean is exact on them), and so is the quantisation of structured
/// light. 0 where more than a quarter of a block was not measured, or a block reaches across a
/// depth edge.
/// @param depth_m  CV_32FC1, metres, 0 where nothing was measured, of the image's size; a working
///        image is returned as it is, with the same pixels.
/// @throws std::invalid_argument if it has another size or type, and as WorkingBlock().
[[nodiscard]] cv::Mat WorkingDepth(const cv::Mat& depth_m, const Intrinsics& image,
                                   const DepthNoise& noise);

/// Where a pixel of the image is in its depth image, which is of the image's size or at working
/// resolution.
[[nodiscard]] Eigen::Vector2d InDepthImage(const Eigen::Vector2d& pixel, const Intrinsics& image,
                                           const cv::Mat& depth_m);

/// Working image of colour: of each block the pixel in its middle.
/// @param rgb  CV_8UC3 of the image's size; a working image is returned as it is, with the same
///        pixels.
/// @throws std::invalid_argument as WorkingDepth().
[[nodiscard]] cv::Mat WorkingColor(const cv::Mat& rgb, const Intrinsics& image);

}  // namespace plumb
