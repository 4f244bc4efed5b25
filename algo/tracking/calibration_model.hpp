// What a sweep can tell of its own sensor: small corrections to the stated calibration, with how far each is trusted.
#pragma once

#include <array>
#include <map>
#include <string>

#include "algo/types/intrinsics.hpp"

namespace plumb {

/// Corrections; all zero means that the stated calibration holds. Blocks are arrays because the solver wants them so.
struct CalibrationModel {
  /// fx' = fx (1 + l[0]), fy' = fy (1 + l[1]), cx' = cx + l[2], cy' = cy + l[3], k1' = k1 + l[4], k2' = k2 + l[5].
  std::array<double, 6> lens{};
  /// Time to read the colour image's rows from top to bottom, seconds; the stamp belongs to the middle row.
  std::array<double, 1> readout_s{};
  /// Edges of markers seen too far inside the black (> 0), pixels at 640 columns.
  std::array<double, 1> edge_bias_px{};
  /// z' = z (1 + d[0]) + d[1] + d[2] r^2, with r the distance from the image centre (half a width = 1);
  /// d[3], d[4]: pixels (at 640 columns) that the depth image lies to the right of and below the colour image;
  /// d[5]: seconds that depth was taken later than stamped, relative to colour.
  std::array<double, 6> depth{};

  /// Prior standard deviations, in the same order: what consumer sensors and their calibrations scatter.
  static constexpr std::array<double, 6> kLensSigma = {0.005, 0.005, 3.0, 3.0, 0.02, 0.05};
  static constexpr double kReadoutSigma = 0.02;
  static constexpr double kEdgeBiasSigma = 0.1;
  static constexpr std::array<double, 6> kDepthSigma = {0.01, 0.003, 0.004, 2.0, 2.0, 0.004};

  [[nodiscard]] Intrinsics Corrected(const Intrinsics& stated) const;
  /// Corrected depth of a measurement at a pixel.
  [[nodiscard]] double CorrectedDepth(double z_m, double x_px, double y_px, const Intrinsics& stated) const;
  /// For reports: names carry units.
  [[nodiscard]] std::map<std::string, double> Named() const;
};

/// r^2 of the depth bow at a pixel: 1 half an image width off the centre.
[[nodiscard]] double BowRadiusSquared(double x_px, double y_px, int width, int height);

}  // namespace plumb
