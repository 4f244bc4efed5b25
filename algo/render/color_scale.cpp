// SPDX-License-Identifier: Apache-2.0
#include "algo/render/color_scale.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <stdexcept>

#include <fmt/format.h>

#include "algo/base/units.hpp"

namespace plumb {
namespace {

constexpr double kRangeInTolerances = 20.0;
constexpr double kPaperRange_m = 10 * kCentimetre;

struct Stop {
  double at;
  Color color;
};

// Lightness decreases equally on both sides, so that size can be read without hue and sign without
// lightness. `at` is |position| from the middle of the legend; log(2)/log(21) = 0.228 is the
// tolerance.
constexpr double kAtTolerance = 0.2277;
constexpr std::array<Stop, 7> kBelow = {{{0.0, {250, 250, 248}},
                                         {kAtTolerance - 1e-4, {226, 236, 243}},
                                         {kAtTolerance, {184, 212, 233}},
                                         {0.36, {126, 177, 216}},
                                         {0.588, {54, 121, 184}},
                                         {0.788, {22, 75, 140}},
                                         {1.0, {8, 34, 84}}}};
constexpr std::array<Stop, 7> kAbove = {{{0.0, {250, 250, 248}},
                                         {kAtTolerance - 1e-4, {246, 234, 218}},
                                         {kAtTolerance, {249, 208, 156}},
                                         {0.36, {244, 165, 84}},
                                         {0.588, {214, 102, 24}},
                                         {0.788, {154, 58, 8}},
                                         {1.0, {92, 24, 4}}}};

Color Between(std::span<const Stop> stops, double at) {
  std::size_t next = 1;
  while (next + 1 < stops.size() && stops[next].at < at) ++next;
  const Stop &low = stops[next - 1], &high = stops[next];
  return Mix(low.color, high.color, std::clamp((at - low.at) / (high.at - low.at), 0.0, 1.0));
}

}  // namespace

Color Mix(const Color& a, const Color& b, double fraction_of_b) {
  Color mixed;
  for (std::size_t i = 0; i < mixed.size(); ++i)
    mixed[i] = static_cast<std::uint8_t>(std::lround(a[i] + fraction_of_b * (b[i] - a[i])));
  return mixed;
}

ColorScale ColorScale::Signed(double tolerance_m) {
  if (!(tolerance_m > 0) || !std::isfinite(tolerance_m)) {
    throw std::invalid_argument(
        fmt::format("a colour scale needs a tolerance above 0 m, found {}", tolerance_m));
  }
  return {true, tolerance_m};
}

ColorScale ColorScale::Paper() { return {false, 0.0}; }

double ColorScale::Position(double difference_m) const {
  if (!is_signed_) return std::clamp(std::abs(difference_m) / kPaperRange_m, 0.0, 1.0);
  const double size = std::min(
      1.0, std::log1p(std::abs(difference_m) / tolerance_m_) / std::log1p(kRangeInTolerances));
  return 0.5 + std::copysign(0.5 * size, difference_m);
}

double ColorScale::Difference(double position) const {
  if (!is_signed_) return position * kPaperRange_m;
  const double size = std::abs(2.0 * position - 1.0);
  return std::copysign(tolerance_m_ * std::expm1(size * std::log1p(kRangeInTolerances)),
                       position - 0.5);
}

Color ColorScale::operator()(double difference_m) const {
  if (std::isnan(difference_m)) return kHoleColor;
  const double position = Position(difference_m);
  if (!is_signed_) {
    const auto red = static_cast<std::uint8_t>(std::lround(255.0 * position));
    return {red, 0, static_cast<std::uint8_t>(255 - red)};
  }
  return Between(difference_m < 0 ? std::span<const Stop>(kBelow) : std::span<const Stop>(kAbove),
                 std::abs(2.0 * position - 1.0));
}

std::vector<ColorScale::Tick> ColorScale::Ticks() const {
  std::vector<Tick> ticks;
  if (!is_signed_) {
    for (int cm = 0; cm <= 10; cm += 2) ticks.push_back({cm * kCentimetre, fmt::format("{}", cm)});
    return ticks;
  }
  for (const double multiple : {-20.0, -10.0, -5.0, -2.0, -1.0, 0.0, 1.0, 2.0, 5.0, 10.0, 20.0}) {
    const double difference_m = multiple * tolerance_m_;
    const std::string size = fmt::format("{:.3g}", std::abs(difference_m) / kMillimetre);
    ticks.push_back({difference_m, multiple == 0 ? "0" : (multiple < 0 ? "\u2212" : "+") + size});
  }
  return ticks;
}

}  // namespace plumb
