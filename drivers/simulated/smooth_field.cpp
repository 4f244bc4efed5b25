#include "drivers/simulated/smooth_field.hpp"

#include <array>
#include <cmath>

#include "drivers/simulated/random.hpp"

namespace plumb::simulated {
namespace {

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
