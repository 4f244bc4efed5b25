// What a sweep reveals about its own sensor: small corrections to the stated calibration, with how
// far each is trusted.
#pragma once

#include <array>
#include <map>
#include <string>

#include "algo/base/intrinsics.hpp"

namespace plumb {

/// Corrections; all zero means that the stated calibration holds. Blocks are arrays because the
/// solver wants them so.
struct CalibrationModel {
  /// fx' = fx (1 + l[0]), fy' = fy (1 + l[1]), cx' = cx + l[2], cy' = cy + l[3], k1' = k1 + l[4],
  /// k2' = k2 + l[5].
  std::array<double, 6> lens{};
  /// Time to read the colour image's rows from top to bottom, seconds; the stamp belongs to the
  /// middle row.
  std::array<double, 1> readout_s{};
  /// Edges of markers seen too far inside the black (> 0), pixels at 640 columns.
  std::array<double, 1> edge_bias_px{};
  /// z' = z (1 + d[0] + d[6] x + d[7] y) + d[1] + d[2] (x^2 + y^2), with x to the right and y down
  /// from the image centre, half a width = 1. The slopes d[6], d[7] are a depth camera turned
  /// against the colour camera. d[3], d[4]: pixels (at 640 columns) that the depth image lies to
  /// the right of and below the colour image; d[5]: seconds that depth was taken later than
  /// stamped, relative to colour. d[8]: seconds to read the depth image from top to bottom; its
  /// stamp belongs to the middle row.
  static constexpr int kDepthSize = 9;
  std::array<double, kDepthSize> depth{};

  /// Prior standard deviations, in the same order: what consumer sensors and their calibrations
  /// scatter.
  static constexpr std::array<double, 6> kLensSigma = {0.002, 0.002, 1.5, 1.5, 0.01, 0.02};
  static constexpr double kReadoutSigma = 0.02;
  static constexpr double kEdgeBiasSigma = 0.04;
  static constexpr std::array<double, kDepthSize> kDepthSigma = {0.01,  0.003, 0.004, 2.0, 2.0,
                                                                 0.004, 0.003, 0.003, 0.02};

  [[nodiscard]] Intrinsics Corrected(const Intrinsics& stated) const;
  /// Corrected depth of a measurement at CentredCoordinates().
  [[nodiscard]] double CorrectedDepth(double z_m, const Eigen::Vector2d& centred) const {
    return z_m * (1.0 + depth[0] + depth[6] * centred.x() + depth[7] * centred.y()) + depth[1] +
           depth[2] * centred.squaredNorm();
  }
  /// For reports: names carry units.
  [[nodiscard]] std::map<std::string, double> Named() const;
};

/// Image coordinates of the depth model: from the centre, half an image width = 1.
[[nodiscard]] Eigen::Vector2d CentredCoordinates(double x_px, double y_px, int width, int height);

}  // namespace plumb
