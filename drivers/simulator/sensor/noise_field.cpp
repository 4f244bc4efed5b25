// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/sensor/noise_field.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <tbb/parallel_for.h>

#include "drivers/simulator/world/random.hpp"

namespace plumb::simulated {
namespace {

// Sum of the four 16-bit parts of a hash: variance 1, mean 0, approximately normal, and normal
// after the filter.
float White(std::uint64_t hash) {
  constexpr float kMean = 2.0F * 65535.0F;
  constexpr float kInverseSigma = 1.0F / 37837.2F;  // sqrt(4/12) 65536
  const auto sum = static_cast<float>((hash & 0xffff) + ((hash >> 16) & 0xffff) +
                                      ((hash >> 32) & 0xffff) + (hash >> 48));
  return (sum - kMean) * kInverseSigma;
}

// Taps of the filter, centre first, scaled so that white noise keeps its variance.
std::vector<float> Taps(double sigma_px) {
  const int reach = sigma_px > 0 ? std::max(1, static_cast<int>(std::ceil(3.0 * sigma_px))) : 0;
  std::vector<double> taps;
  double power = 0;
  for (int i = 0; i <= reach; ++i) {
    taps.push_back(reach > 0 ? std::exp(-0.5 * i * i / (sigma_px * sigma_px)) : 1.0);
    power += (i > 0 ? 2.0 : 1.0) * taps.back() * taps.back();
  }
  std::vector<float> scaled;
  for (const double tap : taps) scaled.push_back(static_cast<float>(tap / std::sqrt(power)));
  return scaled;
}

constexpr int kBumps = 24;
constexpr double kNarrowest = 0.08;  // Fraction of the image's width.
constexpr double kWidest = 0.35;

struct Bump {
  double x, y, inverse_width_x, inverse_width_y, height;
};

std::array<Bump, kBumps> DrawBumps(std::uint64_t seed, double aspect) {
  RandomStream random(seed);
  std::array<Bump, kBumps> bumps{};
  for (Bump& bump : bumps) {
    const double width = kNarrowest * std::pow(kWidest / kNarrowest, random.Uniform());
    const double stretch = random.Uniform(0.7, 1.4);
    bump.x = random.Uniform(-0.1, 1.1);
    bump.y = aspect * random.Uniform(-0.1, 1.1);
    bump.inverse_width_x = stretch / width;
    bump.inverse_width_y = 1.0 / (stretch * width);
    bump.height = random.Normal();
  }
  return bumps;
}

}  // namespace

double FilterSigmaOfLag(double lag_px) { return lag_px / (2.0 * std::sqrt(std::log(10.0))); }

std::vector<float> CorrelatedNoise(std::uint64_t seed, int width, int height, double sigma_px) {
  const std::vector<float> taps = Taps(sigma_px);
  const int reach = static_cast<int>(taps.size()) - 1;
  const auto w = static_cast<std::size_t>(width);
  std::vector<float> rows(w * static_cast<std::size_t>(height));
  tbb::parallel_for(0, height, [&](int y) {
    // The row with its wrapped ends on both sides.
    std::vector<float> padded(w + 2 * static_cast<std::size_t>(reach));
    const auto r = static_cast<std::size_t>(reach);
    for (std::size_t x = 0; x < w; ++x)
      padded[r + x] = White(Hash(seed, static_cast<std::uint64_t>(y) * w + x));
    for (std::size_t i = 0; i < r; ++i) {
      padded[r - 1 - i] = padded[r + (w - 1 - i % w)];
      padded[r + w + i] = padded[r + i % w];
    }
    float* out = &rows[static_cast<std::size_t>(y) * w];
    const float* centre = padded.data() + reach;
    for (std::size_t x = 0; x < w; ++x) out[x] = taps[0] * centre[x];
    for (int k = 1; k <= reach; ++k) {
      const float tap = taps[static_cast<std::size_t>(k)];
      for (int x = 0; x < width; ++x) out[x] += tap * (centre[x - k] + centre[x + k]);
    }
  });
  std::vector<float> field(rows.size());
  tbb::parallel_for(0, height, [&](int y) {
    float* out = &field[static_cast<std::size_t>(y) * w];
    for (int k = -reach; k <= reach; ++k) {
      const float tap = taps[static_cast<std::size_t>(std::abs(k))];
      const float* in = &rows[static_cast<std::size_t>(((y + k) % height + height) % height) * w];
      for (std::size_t x = 0; x < w; ++x) out[x] += tap * in[x];
    }
  });
  return field;
}

std::vector<float> SmoothField(std::uint64_t seed, int width, int height) {
  const auto w = static_cast<std::size_t>(width);
  const auto h = static_cast<std::size_t>(height);
  const std::array<Bump, kBumps> bumps = DrawBumps(seed, static_cast<double>(height) / width);
  std::vector<double> sum(w * h, 0.0);
  std::vector<double> across(w);
  const auto profile = [&](std::size_t i, double centre, double inverse_width) {
    const double d = ((static_cast<double>(i) + 0.5) / width - centre) * inverse_width;
    return std::exp(-0.5 * d * d);
  };
  for (const Bump& bump : bumps) {
    for (std::size_t x = 0; x < w; ++x) across[x] = profile(x, bump.x, bump.inverse_width_x);
    for (std::size_t y = 0; y < h; ++y) {
      const double down = bump.height * profile(y, bump.y, bump.inverse_width_y);
      for (std::size_t x = 0; x < w; ++x) sum[y * w + x] += down * across[x];
    }
  }
  double mean = 0, power = 0;
  for (const double value : sum) mean += value;
  mean /= static_cast<double>(sum.size());
  for (const double value : sum) power += (value - mean) * (value - mean);
  const double inverse_rms = std::sqrt(static_cast<double>(sum.size()) / power);
  std::vector<float> field;
  field.reserve(sum.size());
  for (const double value : sum) field.push_back(static_cast<float>((value - mean) * inverse_rms));
  return field;
}

}  // namespace plumb::simulated
