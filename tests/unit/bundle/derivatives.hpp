// SPDX-License-Identifier: Apache-2.0
// Compares derivatives with differences of the values.
#pragma once

#include <algorithm>
#include <functional>

#include <Eigen/Core>

namespace plumb {

/// Largest difference between a derivative and central differences of `value` over the coordinates
/// of a vector.
template <int kRows, int kColumns>
double Mismatch(
    const Eigen::Matrix<double, kRows, kColumns>& derivative,
    const std::function<Eigen::Matrix<double, kRows, 1>(const Eigen::Matrix<double, kColumns, 1>&)>&
        value,
    double step_size = 1e-6) {
  double worst = 0;
  for (int i = 0; i < kColumns; ++i) {
    Eigen::Matrix<double, kColumns, 1> step = Eigen::Matrix<double, kColumns, 1>::Zero();
    step[i] = step_size;
    const Eigen::Matrix<double, kRows, 1> difference =
        (value(step) - value(-step)) / (2 * step_size);
    worst = std::max(worst, (difference - derivative.col(i)).cwiseAbs().maxCoeff());
  }
  return worst;
}

}  // namespace plumb
