// SPDX-License-Identifier: Apache-2.0
// A direction in four bytes.
#pragma once

#include <cmath>
#include <cstdint>

#include <Eigen/Core>

namespace plumb {

/// A finite unit vector, projected onto an octahedron whose lower half is folded outwards into a
/// square, whose coordinates are kept. Accurate to 0.004 deg.
class PackedNormal {
 public:
  PackedNormal() = default;  ///< The z axis.
  explicit PackedNormal(const Eigen::Vector3f& unit) {
    const Eigen::Vector2f flat = unit.head<2>() / unit.cwiseAbs().sum();
    const Eigen::Vector2f place = unit.z() < 0 ? Fold(flat) : flat;
    x_ = static_cast<std::int16_t>(std::lrintf(kSteps * place.x()));
    y_ = static_cast<std::int16_t>(std::lrintf(kSteps * place.y()));
  }

  [[nodiscard]] Eigen::Vector3f Unit() const {
    const Eigen::Vector2f place(static_cast<float>(x_) / kSteps, static_cast<float>(y_) / kSteps);
    const float z = 1.0F - std::abs(place.x()) - std::abs(place.y());
    const Eigen::Vector2f flat = z < 0 ? Fold(place) : place;
    return Eigen::Vector3f(flat.x(), flat.y(), z).normalized();
  }

  bool operator==(const PackedNormal&) const = default;

 private:
  static constexpr float kSteps = 32767.0F;

  // Exchanges the inside of the square's diamond and its corners.
  static Eigen::Vector2f Fold(const Eigen::Vector2f& place) {
    return {std::copysign(1.0F - std::abs(place.y()), place.x()),
            std::copysign(1.0F - std::abs(place.x()), place.y())};
  }

  std::int16_t x_ = 0;
  std::int16_t y_ = 0;
};

}  // namespace plumb
