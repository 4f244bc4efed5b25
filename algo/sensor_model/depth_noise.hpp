// SPDX-License-Identifier: Apache-2.0
// How much the measurements of a depth camera scatter, as its driver or its recording states it.
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <optional>
#include <string>

#include "algo/base/message.hpp"

namespace plumb {

/// Standard deviation of one depth measurement along the optical axis. At the distance z (metres)
/// and the angle of incidence theta it is, in metres,
///
///   constant_m + linear_m_per_m (z - origin_m) + quadratic_m_per_m2 (z - origin_m)^2
///     + grazing_m / sqrt(z) (theta / (pi/2 - theta))^2.
///
/// The defaults are those of structured light (Kinect; Nguyen et al. 2012, axial). A polynomial in
/// z itself has origin_m 0, and a sensor whose noise does not depend on the incidence grazing_m 0.
struct DepthNoise {
  double constant_m = 0.0012;
  double linear_m_per_m = 0.0;
  double quadratic_m_per_m2 = 0.0019;
  double origin_m = 0.4;      ///< Distance about which the polynomial is written.
  double grazing_m = 0.0001;  ///< What an incidence of 45 deg adds at 1 m.

  /// Of a surface that faces the camera.
  /// @tparam Real  Type of the computation; the surfaces' is float.
  template <std::floating_point Real>
  [[nodiscard]] Real SigmaFacing_m(Real z_m) const {
    const Real off_m = z_m - static_cast<Real>(origin_m);
    return static_cast<Real>(constant_m) + static_cast<Real>(linear_m_per_m) * off_m +
           static_cast<Real>(quadratic_m_per_m2) * off_m * off_m;
  }

  /// @param grazing  theta / (pi/2 - theta) of the angle of incidence: 0 facing, 1 at 45 deg.
  template <std::floating_point Real>
  [[nodiscard]] Real Sigma_m(Real z_m, Real grazing) const {
    constexpr Real kNearest_m = static_cast<Real>(0.1);  // finite, however near
    return SigmaFacing_m(z_m) +
           static_cast<Real>(grazing_m) / std::sqrt(std::max(z_m, kNearest_m)) * grazing * grazing;
  }

  bool operator==(const DepthNoise&) const = default;
};

/// Limits of what a driver or a recording may state. The smallest is below the noise of any depth
/// camera; a larger one than the largest, at 1 m, is useless for the method or was given in
/// millimetres.
inline constexpr double kLeastDepthNoise_m = 1e-5;
inline constexpr double kMostDepthNoiseAt1m_m = 0.1;

/// Why a stated noise cannot be used: the value's name, what it is and what is expected. Nothing if
/// it can be used: then it is at least kLeastDepthNoise_m at every distance from 0 on, and finite
/// at every finite one.
[[nodiscard]] std::optional<Message> FaultOf(const DepthNoise& noise);

}  // namespace plumb
