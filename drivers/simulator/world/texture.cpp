// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/world/texture.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include <tbb/parallel_for.h>

#include "drivers/simulator/world/float4.hpp"
#include "drivers/simulator/world/random.hpp"

namespace plumb::simulated {
namespace {

using Byte8 = std::uint8_t __attribute__((vector_size(8)));
using Short4 = std::uint16_t __attribute__((vector_size(8)));
using Short8 = std::uint16_t __attribute__((vector_size(16)));
// Far from zero, so that the conversion to an integer rounds down everywhere in a room.
constexpr int kOffset = 1 << 14;
constexpr int kFractions =
    16;  // Subdivisions of a texel; fine enough, and the sums of 8-bit values fit into 16 bits.
constexpr float kScale = 1.0F / (255.0F * kFractions * kFractions);

using Eigen::Vector2f;
using Eigen::Vector3f;

std::uint32_t EncodeChannel(float albedo) {
  return static_cast<std::uint32_t>(255.0F * std::sqrt(std::clamp(albedo, 0.0F, 1.0F)) + 0.5F);
}

std::uint32_t Encode(const Vector3f& albedo) {
  return EncodeChannel(albedo.x()) | EncodeChannel(albedo.y()) << 8 |
         EncodeChannel(albedo.z()) << 16;
}

Vector3f Decode(std::uint32_t texel) {
  const Vector3f root =
      Vector3f(static_cast<float>(texel & 0xffU), static_cast<float>((texel >> 8) & 0xffU),
               static_cast<float>(texel >> 16)) /
      255.0F;
  return root.cwiseProduct(root);
}

// Reflects an index into [0, size): the texture repeats mirrored.
int Mirror(int i, int size) {
  const int period = 2 * size;
  i %= period;
  if (i < 0) i += period;
  return i < size ? i : period - 1 - i;
}

Vector2f PointIn(RandomStream& random, const Texture& texture) {
  const Vector2f low = texture.low();
  const Vector2f high = texture.high();
  const auto x = static_cast<float>(random.Uniform(low.x(), high.x()));
  return {x, static_cast<float>(random.Uniform(low.y(), high.y()))};
}

// Short strokes of random position, direction and shade.
void Scatter(Texture& texture, RandomStream& random, int count, float shortest, float longest,
             float width, float darkest, float brightest, float opacity) {
  for (int i = 0; i < count; ++i) {
    const Vector2f from = PointIn(random, texture);
    const auto angle = static_cast<float>(random.Uniform(0.0, 2.0 * std::numbers::pi));
    const auto length = static_cast<float>(random.Uniform(shortest, longest));
    const auto shade = static_cast<float>(random.Uniform(darkest, brightest));
    const auto tint = static_cast<float>(random.Within(0.15));
    const auto thickness = width * static_cast<float>(random.Uniform(0.5, 1.5));
    texture.Stroke(from, from + length * Vector2f(std::cos(angle), std::sin(angle)), thickness,
                   shade * Vector3f(1 + tint, 1, 1 - tint), opacity);
  }
}

}  // namespace

Texture::Texture(const Vector2f& low, float step, int width, int height, const Vector3f& albedo)
    : low_(low), step_(step), inverse_step_(1.0F / step), width_(width), height_(height) {
  texels_.assign(Index(0, height), Encode(albedo));
}

inline Int4 Texture::Between(int x0, int y0, int wu, int wv) const {
  int x1 = x0 + 1;
  int y1 = y0 + 1;
  if (x0 < 0 || y0 < 0 || x1 >= width_ || y1 >= height_) {
    x0 = Mirror(x0, width_);
    x1 = Mirror(x1, width_);
    y0 = Mirror(y0, height_);
    y1 = Mirror(y1, height_);
  }
  // Interpolated before squaring, in integers; all channels of two texels at a time.
  const auto right = static_cast<std::uint16_t>(wu);
  const auto left = static_cast<std::uint16_t>(kFractions - wu);
  const Short8 across{left, left, left, left, right, right, right, right};
  const auto pair = [&](int row) {
    const std::array<Texel, 2> texels = {texels_[Index(x0, row)], texels_[Index(x1, row)]};
    Byte8 bytes;
    std::memcpy(&bytes, texels.data(), sizeof(bytes));
    return __builtin_convertvector(bytes, Short8) * across;
  };
  const Short8 both = pair(y0) * static_cast<std::uint16_t>(kFractions - wv) +
                      pair(y1) * static_cast<std::uint16_t>(wv);
  const Short4 sum = __builtin_shufflevector(both, both, 0, 1, 2, 3) +
                     __builtin_shufflevector(both, both, 4, 5, 6, 7);
  return __builtin_convertvector(sum, Int4);
}

Vector3f Texture::At(Float4 x, Float4 y) const {
  const Float4 gx = (x - low_.x()) * inverse_step_;
  const Float4 gy = (y - low_.y()) * inverse_step_;
  const Int4 x0 = __builtin_convertvector(gx + static_cast<float>(kOffset), Int4) - kOffset;
  const Int4 y0 = __builtin_convertvector(gy + static_cast<float>(kOffset), Int4) - kOffset;
  const Int4 wu =
      __builtin_convertvector(kFractions * (gx - __builtin_convertvector(x0, Float4)) + 0.5F, Int4);
  const Int4 wv =
      __builtin_convertvector(kFractions * (gy - __builtin_convertvector(y0, Float4)) + 0.5F, Int4);
  Float4 sum = Splat(0.0F);
  for (int i = 0; i < 4; ++i) {
    const Float4 root = __builtin_convertvector(Between(x0[i], y0[i], wu[i], wv[i]), Float4);
    sum += root * root;
  }
  return 0.25F * kScale * kScale * Vector3f(sum[0], sum[1], sum[2]);
}

Vector3f Texture::At(float x, float y) const {
  const float gx = (x - low_.x()) * inverse_step_;
  const float gy = (y - low_.y()) * inverse_step_;
  const int x0 = static_cast<int>(gx + kOffset) - kOffset;
  const int y0 = static_cast<int>(gy + kOffset) - kOffset;
  const auto wu = static_cast<int>(kFractions * (gx - static_cast<float>(x0)) + 0.5F);
  const auto wv = static_cast<int>(kFractions * (gy - static_cast<float>(y0)) + 0.5F);
  const Float4 root = kScale * __builtin_convertvector(Between(x0, y0, wu, wv), Float4);
  return {root[0] * root[0], root[1] * root[1], root[2] * root[2]};
}

void Texture::Blend(int x, int y, const Vector3f& color, float opacity) {
  Texel& texel = texels_[Index(x, y)];
  const Vector3f before = Decode(texel);
  texel = Encode(before + opacity * (color - before));
}

void Texture::Mottle(std::uint64_t seed, float cell, float amplitude) {
  const int columns = static_cast<int>(static_cast<float>(width_) * step_ / cell) + 2;
  const int rows = static_cast<int>(static_cast<float>(height_) * step_ / cell) + 2;
  std::vector<float> lattice(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
  for (std::size_t i = 0; i < lattice.size(); ++i)
    lattice[i] = static_cast<float>(2.0 * UnitUniform(Hash(seed, i)) - 1.0);
  const auto smooth = [](float u) { return u * u * (3.0F - 2.0F * u); };
  tbb::parallel_for(0, height_, [&](int y) {
    const float gy = static_cast<float>(y) * step_ / cell;
    const int row = static_cast<int>(gy);
    const float v = smooth(gy - static_cast<float>(row));
    const float* lower =
        &lattice[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns)];
    const float* upper = lower + columns;
    for (int x = 0; x < width_; ++x) {
      const float gx = static_cast<float>(x) * step_ / cell;
      const int column = static_cast<int>(gx);
      const float u = smooth(gx - static_cast<float>(column));
      const float a = lower[column] + u * (lower[column + 1] - lower[column]);
      const float b = upper[column] + u * (upper[column + 1] - upper[column]);
      const float factor = 1.0F + amplitude * (a + v * (b - a));
      Texel& texel = texels_[Index(x, y)];
      texel = Encode(factor * Decode(texel));
    }
  });
}

void Texture::Stroke(const Vector2f& from, const Vector2f& to, float width, const Vector3f& color,
                     float opacity) {
  const Vector2f reach = Vector2f::Constant(width / 2 + step_);
  const Vector2f first = (from.cwiseMin(to) - reach - low_) / step_;
  const Vector2f last = (from.cwiseMax(to) + reach - low_) / step_;
  const Vector2f axis = to - from;
  const float length_squared = std::max(1e-12F, axis.squaredNorm());
  for (int y = std::max(0, static_cast<int>(first.y()));
       y <= std::min(height_ - 1, static_cast<int>(last.y())); ++y) {
    for (int x = std::max(0, static_cast<int>(first.x()));
         x <= std::min(width_ - 1, static_cast<int>(last.x())); ++x) {
      const Vector2f p = low_ + step_ * Vector2f(static_cast<float>(x), static_cast<float>(y));
      const float along = std::clamp((p - from).dot(axis) / length_squared, 0.0F, 1.0F);
      const float cover =
          std::clamp((width / 2 - (p - from - along * axis).norm()) / step_ + 0.5F, 0.0F, 1.0F);
      if (cover > 0) Blend(x, y, color, cover * opacity);
    }
  }
}

Texture PaintFloor(std::uint64_t seed) {
  RandomStream random(Hash(seed, 11));
  const auto warmth = static_cast<float>(random.Within(0.05));
  const auto base = static_cast<float>(random.Uniform(0.34, 0.44));
  Texture texture({-1.6F, -1.3F}, 0.00125F, 2560, 2080, base * Vector3f(1 + warmth, 1, 1 - warmth));
  texture.Mottle(Hash(seed, 12), 0.25F, 0.06F);
  texture.Mottle(Hash(seed, 13), 0.03F, 0.06F);
  texture.Mottle(Hash(seed, 14), 0.006F, 0.10F);
  Scatter(texture, random, 9000, 0.002F, 0.010F, 0.0035F, 0.13F, 0.30F, 0.85F);
  Scatter(texture, random, 5000, 0.002F, 0.008F, 0.0030F, 0.55F, 0.75F, 0.80F);
  Scatter(texture, random, 700, 0.004F, 0.016F, 0.0070F, 0.10F, 0.60F, 0.75F);
  Scatter(texture, random, 60, 0.03F, 0.15F, 0.0020F, 0.10F, 0.20F, 0.60F);
  for (float line = -1.5F; line < 1.6F; line += 0.61F) {
    texture.Stroke({line, -1.3F}, {line, 1.3F}, 0.0025F, Vector3f::Constant(0.12F), 0.8F);
    texture.Stroke({-1.6F, line * 0.9F + 0.11F}, {1.6F, line * 0.9F + 0.11F}, 0.0025F,
                   Vector3f::Constant(0.12F), 0.8F);
  }
  const Vector2f tape(static_cast<float>(random.Uniform(-0.9, -0.5)),
                      static_cast<float>(random.Uniform(-0.6, 0.6)));
  const auto slant = static_cast<float>(random.Within(0.6));
  texture.Stroke(tape, tape + 0.45F * Vector2f(std::sin(slant), std::cos(slant)), 0.045F,
                 {0.62F, 0.47F, 0.08F}, 0.95F);
  return texture;
}

Texture PaintSheet(std::uint64_t seed) {
  RandomStream random(Hash(seed, 21));
  Texture texture({-1.3F, -0.8F}, 0.00125F, 2400, 1280, Vector3f(0.38F, 0.46F, 0.52F));
  for (float y = -0.8F; y < 0.8F; y += 0.085F) {
    const auto shade = static_cast<float>(random.Uniform(0.20, 0.65));
    const auto shift = static_cast<float>(random.Within(0.02));
    texture.Stroke({-1.3F, y + shift}, {1.7F, y + shift + 0.01F},
                   static_cast<float>(random.Uniform(0.004, 0.02)),
                   {0.8F * shade, 0.95F * shade, shade}, 0.8F);
  }
  for (int motif = 0; motif < 420; ++motif) {
    const Vector2f centre = PointIn(random, texture);
    const auto size = static_cast<float>(random.Uniform(0.006, 0.02));
    const auto shade = static_cast<float>(random.Uniform(0.08, 0.75));
    texture.Stroke(centre - Vector2f(size, 0), centre + Vector2f(size, 0), 0.3F * size,
                   {shade, 0.8F * shade, 0.7F * shade}, 0.9F);
    texture.Stroke(centre - Vector2f(0, size), centre + Vector2f(0, size), 0.3F * size,
                   {shade, 0.8F * shade, 0.7F * shade}, 0.9F);
  }
  texture.Mottle(Hash(seed, 22), 0.20F, 0.10F);
  texture.Mottle(Hash(seed, 23), 0.02F, 0.08F);
  texture.Mottle(Hash(seed, 24), 0.005F, 0.12F);
  Scatter(texture, random, 7000, 0.002F, 0.009F, 0.0030F, 0.12F, 0.70F, 0.7F);
  return texture;
}

Texture PaintSkin(std::uint64_t seed) {
  RandomStream random(Hash(seed, 31));
  Texture texture({-0.8F, -0.6F}, 0.001F, 2100, 1200, Vector3f(0.60F, 0.50F, 0.41F));
  texture.Mottle(Hash(seed, 32), 0.12F, 0.06F);
  texture.Mottle(Hash(seed, 33), 0.025F, 0.06F);
  texture.Mottle(Hash(seed, 34), 0.007F, 0.07F);
  Scatter(texture, random, 2600, 0.0005F, 0.003F, 0.0030F, 0.16F, 0.36F, 0.55F);
  Scatter(texture, random, 900, 0.0005F, 0.002F, 0.0050F, 0.12F, 0.30F, 0.6F);
  Scatter(texture, random, 700, 0.004F, 0.020F, 0.0018F, 0.18F, 0.36F, 0.45F);
  Scatter(texture, random, 400, 0.002F, 0.010F, 0.0040F, 0.62F, 0.80F, 0.5F);
  for (int cross = 0; cross < 26; ++cross) {
    const Vector2f centre(static_cast<float>(random.Uniform(-0.45, 0.9)),
                          static_cast<float>(random.Within(0.2)));
    const auto angle = static_cast<float>(random.Within(0.3));
    const Vector2f arm(0.014F * std::cos(angle), 0.014F * std::sin(angle));
    texture.Stroke(centre - arm, centre + arm, 0.0022F, {0.08F, 0.09F, 0.22F}, 0.9F);
    texture.Stroke(centre - Vector2f(-arm.y(), arm.x()), centre + Vector2f(-arm.y(), arm.x()),
                   0.0022F, {0.08F, 0.09F, 0.22F}, 0.9F);
  }
  for (const float seam : {-0.345F, 0.245F}) {
    texture.Stroke({seam, -0.6F}, {seam + 0.01F, 0.6F}, 0.0016F, Vector3f(0.26F, 0.21F, 0.17F),
                   0.8F);
  }
  return texture;
}

}  // namespace plumb::simulated
