// SPDX-License-Identifier: Apache-2.0
// How a scene would change if its sensor's calibration were another one.
#pragma once

#include <map>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "algo/base/intrinsics.hpp"

namespace plumb {

/// How a scene would change if its sensor's calibration were another one. Each sweep estimates the
/// calibration itself, so two sweeps by one unit give two estimates of the same values, and their
/// difference also shifts the scenes against each other. Terms are those of the calibration model,
/// in its order and units.
struct SensorSensitivity {
  using Derivative = Eigen::Matrix3Xf;  ///< Metres in the scene's frame per unit of each term.

  /// A piece of surface.
  struct Patch {
    Eigen::Vector3f centre_m = Eigen::Vector3f::Zero();  ///< In the scene's frame.
    float weight = 0.0F;                                 ///< Number of depth cells on it.
    Derivative derivative;
  };

  Intrinsics stated;  ///< What the estimate corrects.
  /// False: the stated intrinsics are nominal ones, which many units share.
  bool stated_for_this_unit = false;
  /// Serial number of the sensor; empty if unknown. Units that share nominal intrinsics differ by
  /// it.
  std::string serial;
  Eigen::VectorXd estimate;
  /// Of the estimate. A term that the sweep was not free to change has none, here and in the
  /// derivatives.
  Eigen::MatrixXd covariance;
  std::vector<Patch> surface;
  std::map<int, Derivative> markers;  ///< Of the markers' centres, by id.
};

}  // namespace plumb
