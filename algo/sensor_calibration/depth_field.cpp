// SPDX-License-Identifier: Apache-2.0
#include "algo/sensor_calibration/depth_field.hpp"

#include <algorithm>
#include <tuple>

namespace plumb {
namespace {

constexpr int kOrderX = std::tuple_size_v<FieldAcross> - 1;
constexpr int kOrderY = std::tuple_size_v<FieldDown> - 1;
constexpr double kGrowthFrom_m = 1.0;
constexpr double kGrowthTo_m = 2.0;
constexpr double kTallestImage = 0.75;  // Half the height of a 4:3 image in half widths.

constexpr std::array<FieldOrder, kNumFieldTerms> AllFieldOrders() {
  std::array<FieldOrder, kNumFieldTerms> orders{};
  std::size_t count = 0;
  for (int i = 0; i <= kOrderX; ++i)
    for (int j = 0; j <= kOrderY; ++j)
      if (i + j > 1) orders[count++] = {i, j};
  return orders;
}

// T_0 to T_n at x, clamped to [-1, 1].
template <std::size_t kSize>
std::array<double, kSize> Chebyshev(double x) {
  x = std::clamp(x, -1.0, 1.0);
  std::array<double, kSize> values{};
  values[0] = 1.0;
  values[1] = x;
  for (std::size_t n = 2; n < kSize; ++n) values[n] = 2.0 * x * values[n - 1] - values[n - 2];
  return values;
}

}  // namespace

constinit const std::array<FieldOrder, kNumFieldTerms> kFieldOrders = AllFieldOrders();
constinit const std::array<FieldOrder, kNumGrowthTerms> kGrowthOrders = {
    {{0, 0}, {0, 1}, {0, 2}, {1, 0}, {1, 1}, {2, 0}}};

FieldAcross PolynomialsAcross(double centred_x) { return Chebyshev<kOrderX + 1>(centred_x); }

FieldDown PolynomialsDown(double centred_y) {
  return Chebyshev<kOrderY + 1>(centred_y / kTallestImage);
}

// Not inlined: at -O3, g++ 12 leaves the rounding to float out where the caller converts to double,
// so that results would depend on which sources are compiled together.
[[gnu::noinline]] FieldRow FieldProducts(const FieldAcross& across, const FieldDown& down) {
  const auto product = [&](const FieldOrder& order) {
    return static_cast<float>(across[static_cast<std::size_t>(order.x)] *
                              down[static_cast<std::size_t>(order.y)]);
  };
  FieldRow row;
  int at = 0;
  for (const FieldOrder& order : kFieldOrders) row[at++] = product(order);
  for (const FieldOrder& order : kGrowthOrders) row[at++] = product(order);
  return row;
}

FieldRow FieldProducts(const Eigen::Vector2d& centred) {
  return FieldProducts(PolynomialsAcross(centred.x()), PolynomialsDown(centred.y()));
}

double FieldGrowth(double z_m) { return std::min(z_m, kGrowthTo_m) - kGrowthFrom_m; }

double FieldGrowthSlope(double z_m) { return z_m < kGrowthTo_m ? 1.0 : 0.0; }

Eigen::Vector2d CentredCoordinates(double x_px, double y_px, int width, int height) {
  const double half = width / 2.0;
  return {(x_px - (width - 1) / 2.0) / half, (y_px - (height - 1) / 2.0) / half};
}

}  // namespace plumb
