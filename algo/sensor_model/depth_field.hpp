// How a depth camera's readings are distorted over the image and with distance.
#pragma once

#include <array>

#include <Eigen/Core>

namespace plumb {

/// Places of the depth terms in CalibrationModel::depth.
enum DepthTerm : int {
  kDepthScale = 0,    ///< Share of the depth.
  kDepthOffset = 1,   ///< Metres.
  kDepthBow = 2,      ///< Metres at one half image width from the centre, growing with its square.
  kDepthShiftX = 3,   ///< Pixels (at 640 columns) that depth lies to the right of the colour image.
  kDepthShiftY = 4,   ///< Pixels that depth lies below the colour image.
  kDepthDelay = 5,    ///< Seconds that depth was taken later than stamped, relative to colour.
  kDepthSlopeX = 6,   ///< Share of the depth per half width: a depth camera turned against colour.
  kDepthSlopeY = 7,   ///< The same downwards.
  kDepthReadout = 8,  ///< Seconds to read the image from top to bottom; stamped in the middle row.
  kDepthField = 9,    ///< First of the distortion field's terms.
  kDepthGrowth = 36,  ///< First of the field's terms that grow with distance.
  kNumDepthTerms = 42
};
constexpr int kNumFieldTerms = kDepthGrowth - kDepthField;
constexpr int kNumGrowthTerms = kNumDepthTerms - kDepthGrowth;

/// The field is a sum of products T_i(x) T_j(y) of Chebyshev polynomials of the image position.
/// Structured-light sensors carry such a field of their own, smooth over the image and different
/// from unit to unit (Teichman, Miller, Thrun 2013; Zhou and Koltun 2014).
struct FieldOrder {
  int x = 0;
  int y = 0;
};
/// x to order 5, y to order 4, without the constant and the two slopes, which have terms of their
/// own.
extern const std::array<FieldOrder, kNumFieldTerms> kFieldOrders;
/// To order 2 together.
extern const std::array<FieldOrder, kNumGrowthTerms> kGrowthOrders;

using FieldRow = Eigen::Matrix<float, kNumFieldTerms + kNumGrowthTerms, 1>;
/// The products at CentredCoordinates(): the field's first, then those that grow.
[[nodiscard]] FieldRow FieldProducts(const Eigen::Vector2d& centred);

/// What the growing terms are multiplied by: depth beyond one metre, in metres. It stops at 2 m
/// from the sensor: beyond, a sweep has hardly any readings.
[[nodiscard]] double FieldGrowth(double z_m);
/// Its derivative.
[[nodiscard]] double FieldGrowthSlope(double z_m);

/// Image coordinates of the depth model: from the centre, half an image width = 1.
[[nodiscard]] Eigen::Vector2d CentredCoordinates(double x_px, double y_px, int width, int height);

}  // namespace plumb
