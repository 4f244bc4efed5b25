// SPDX-License-Identifier: Apache-2.0
// Distortion of a depth camera's readings over the image and with distance.
#pragma once

#include <array>

#include <Eigen/Core>

namespace plumb {

/// Positions of the depth terms in CalibrationModel::depth.
enum DepthTerm : int {
  kDepthScale = 0,   ///< Fraction of the depth.
  kDepthOffset = 1,  ///< Metres.
  /// Metres at one half image width from the centre; grows with the square of the distance.
  kDepthBow = 2,
  /// Pixels (at 640 columns) by which depth is displaced to the right of the colour image.
  kDepthShiftX = 3,
  kDepthShiftY = 4,  ///< Pixels by which depth is displaced downwards from the colour image.
  kDepthDelay = 5,   ///< Seconds by which depth was taken later than stamped, relative to colour.
  /// Fraction of the depth per half width, from a depth camera rotated against the colour camera.
  kDepthSlopeX = 6,
  kDepthSlopeY = 7,  ///< The same downwards.
  /// Seconds to read the image from top to bottom, or as ReadByColumns() says; the stamp belongs to
  /// the middle line.
  kDepthReadout = 8,
  kDepthField = 9,    ///< First of the distortion field's terms.
  kDepthGrowth = 36,  ///< First of the field's terms that grow with distance.
  kNumDepthTerms = 42
};
constexpr int kNumFieldTerms = kDepthGrowth - kDepthField;
constexpr int kNumGrowthTerms = kNumDepthTerms - kDepthGrowth;

/// The field is a sum of products T_i(x) T_j(y) of Chebyshev polynomials of the image position.
/// Structured-light sensors have such a field, smooth over the image and different from unit to
/// unit (Teichman, Miller, Thrun 2013; Zhou and Koltun 2014).
struct FieldOrder {
  int x = 0;
  int y = 0;
};
/// x to order 5, y to order 4, without the constant and the two slopes, which have terms of their
/// own.
extern const std::array<FieldOrder, kNumFieldTerms> kFieldOrders;
/// To total order 2.
extern const std::array<FieldOrder, kNumGrowthTerms> kGrowthOrders;

using FieldRow = Eigen::Matrix<float, kNumFieldTerms + kNumGrowthTerms, 1>;
/// The products at CentredCoordinates(): first those of the field, then those of its growth.
[[nodiscard]] FieldRow FieldProducts(const Eigen::Vector2d& centred);

/// The polynomials in one column and in one row, whose cells share them.
using FieldAcross = std::array<double, 6>;  ///< T_0(x) to T_5(x)
using FieldDown = std::array<double, 5>;    ///< T_0(y) to T_4(y)
/// Of one of the CentredCoordinates().
[[nodiscard]] FieldAcross PolynomialsAcross(double centred_x);
[[nodiscard]] FieldDown PolynomialsDown(double centred_y);
/// The products where the column and the row meet.
[[nodiscard]] FieldRow FieldProducts(const FieldAcross& across, const FieldDown& down);

/// Factor of the growing terms: depth beyond one metre, in metres. It is clamped at 2 m from the
/// sensor, because a sweep has hardly any readings beyond.
[[nodiscard]] double FieldGrowth(double z_m);
/// Derivative of FieldGrowth().
[[nodiscard]] double FieldGrowthSlope(double z_m);

/// Image coordinates of the depth model: relative to the centre, with half an image width = 1.
[[nodiscard]] Eigen::Vector2d CentredCoordinates(double x_px, double y_px, int width, int height);

}  // namespace plumb
