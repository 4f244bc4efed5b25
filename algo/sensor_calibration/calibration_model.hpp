// SPDX-License-Identifier: Apache-2.0
// Corrections to a sensor's stated calibration that a sweep estimates, with their prior
// uncertainty.
#pragma once

#include <array>
#include <map>
#include <string>

#include "algo/base/intrinsics.hpp"
#include "algo/sensor_calibration/depth_field.hpp"

namespace plumb {

/// Corrections; all zero means that the stated calibration is correct. The blocks are arrays
/// because the solver uses them as such.
struct CalibrationModel {
  /// fx' = fx (1 + l[0]), fy' = fy (1 + l[1]), cx' = cx + l[2], cy' = cy + l[3], k1' = k1 + l[4],
  /// k2' = k2 + l[5], p1' = p1 + l[6], p2' = p2 + l[7].
  static constexpr int kLensSize = 8;
  using Lens = std::array<double, kLensSize>;
  Lens lens{};
  /// Time to read the colour image's rows from top to bottom (ReadByColumns(): its columns from
  /// left to right), seconds; the stamp belongs to the middle one.
  std::array<double, 1> readout_s{};
  /// Distance by which edges of markers appear too far inside the black (> 0), pixels at 640
  /// columns.
  std::array<double, 1> edge_bias_px{};
  /// Errors of the depth images, by DepthTerm: see DepthCorrection for the equation.
  static constexpr int kDepthSize = kNumDepthTerms;
  std::array<double, kDepthSize> depth{};

  /// Prior standard deviations in the same order, for consumer sensors and their calibrations.
  static constexpr Lens kLensSigma = {0.002, 0.002, 1.5, 1.5, 0.01, 0.02, 0.0007, 0.0007};
  static constexpr double kReadoutSigma = 0.02;
  static constexpr double kEdgeBiasSigma = 0.04;
  static const std::array<double, kDepthSize> kDepthSigma;

  [[nodiscard]] Intrinsics Corrected(const Intrinsics& stated) const;
  /// Corrected depth of one measurement at CentredCoordinates(); whole images use DepthCorrection.
  [[nodiscard]] double CorrectedDepth(double z_m, const Eigen::Vector2d& centred) const;
  /// Names for reports, with units.
  [[nodiscard]] std::map<std::string, double> Named() const;
};

/// Whether a rolling shutter reads this camera's columns one after the other, not its rows: it is a
/// landscape sensor on its side.
[[nodiscard]] inline bool ReadByColumns(const Intrinsics& camera) {
  return camera.height > camera.width;
}

}  // namespace plumb
