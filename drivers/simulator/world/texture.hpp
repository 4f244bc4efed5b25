// SPDX-License-Identifier: Apache-2.0
// Procedural textures with corners at every scale, like natural floors, blankets and mannequins.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "drivers/simulator/world/float4.hpp"

namespace plumb::simulated {

/// Linear-light albedo over a rectangle of a plane; mirrored outside it. Immutable once painted.
class Texture {
 public:
  /// @param low   Corner of the rectangle, metres.  @param step  Texel size, metres.
  Texture(const Eigen::Vector2f& low, float step, int width, int height,
          const Eigen::Vector3f& albedo);

  /// Albedo (red, green, blue) at a position, bilinear between texels.
  [[nodiscard]] Eigen::Vector3f At(float x, float y) const;

  /// Mean albedo over four positions.
  [[nodiscard]] Eigen::Vector3f At(Float4 x, Float4 y) const;

  // Painting. Colours are linear-light albedo in [0, 1]; lengths in metres.

  /// Multiplies by smooth noise with the given cell size: 1 +- amplitude.
  void Mottle(std::uint64_t seed, float cell, float amplitude);
  /// Blends a colour over a thick straight stroke.
  void Stroke(const Eigen::Vector2f& from, const Eigen::Vector2f& to, float width,
              const Eigen::Vector3f& color, float opacity);

  [[nodiscard]] Eigen::Vector2f low() const { return low_; }
  [[nodiscard]] Eigen::Vector2f high() const {
    return low_ +
           step_ * Eigen::Vector2f(static_cast<float>(width_ - 1), static_cast<float>(height_ - 1));
  }

 private:
  /// Square roots of red, green and blue albedo times 255, one byte each from the lowest.
  using Texel = std::uint32_t;
  [[nodiscard]] std::size_t Index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }
  /// Square roots of red, green and blue times 255 * 256, interpolated between four texels; wu, wv
  /// in sixteenths.
  [[nodiscard]] Int4 Between(int x0, int y0, int wu, int wv) const;
  void Blend(int x, int y, const Eigen::Vector3f& color, float opacity);

  Eigen::Vector2f low_;
  float step_;
  float inverse_step_;
  int width_;
  int height_;
  std::vector<Texel> texels_;
};

/// Grey vinyl floor: flecks, scuffs, tile seams, a strip of tape.
[[nodiscard]] Texture PaintFloor(std::uint64_t seed);
/// Woven sheet on a couch: threads, stripes, folds, stitches.
[[nodiscard]] Texture PaintSheet(std::uint64_t seed);
/// Mannequin's or a person's skin: mottling, freckles, seams, drawn crosses.
[[nodiscard]] Texture PaintSkin(std::uint64_t seed);

}  // namespace plumb::simulated
