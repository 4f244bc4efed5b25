// SPDX-License-Identifier: Apache-2.0
#include "algo/render/color_scale.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

namespace plumb {
namespace {

using Linear = std::array<double, 3>;

double Linearised(std::uint8_t value) {
  const double v = value / 255.0;
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

/// How an eye without red (protanope), green (deuteranope) or blue (tritanope) receptors sees a
/// colour, linear RGB (Machado, Oliveira and Fernandes 2009, severity 1).
constexpr std::array<std::array<double, 9>, 3> kColorBlindness = {{
    {0.152286, 1.052583, -0.204868, 0.114503, 0.786281, 0.099216, -0.003882, -0.048116, 1.051998},
    {0.367322, 0.860646, -0.227968, 0.280085, 0.672501, 0.047413, -0.011820, 0.042940, 0.968881},
    {1.255528, -0.076749, -0.178779, -0.078411, 0.930809, 0.147602, 0.004733, 0.691367, 0.303900},
}};

Linear Seen(const Color& color, const std::array<double, 9>& m) {
  const Linear c = {Linearised(color[0]), Linearised(color[1]), Linearised(color[2])};
  Linear seen;
  for (std::size_t i = 0; i < 3; ++i)
    seen[i] = std::clamp(m[3 * i] * c[0] + m[3 * i + 1] * c[1] + m[3 * i + 2] * c[2], 0.0, 1.0);
  return seen;
}

/// CIE 1976 colour difference of linear sRGB, white D65. About 2 is just noticeable.
double Difference(const Linear& a, const Linear& b) {
  const auto lab = [](const Linear& c) {
    const auto f = [](double t) { return t > 0.008856 ? std::cbrt(t) : 7.787 * t + 16.0 / 116.0; };
    const double x = f((0.4124 * c[0] + 0.3576 * c[1] + 0.1805 * c[2]) / 0.9505),
                 y = f(0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]),
                 z = f((0.0193 * c[0] + 0.1192 * c[1] + 0.9505 * c[2]) / 1.089);
    return Linear{116 * y - 16, 500 * (x - y), 200 * (y - z)};
  };
  const Linear p = lab(a), q = lab(b);
  return std::hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]);
}

double Luminance(const Color& c) {
  return 0.2126 * Linearised(c[0]) + 0.7152 * Linearised(c[1]) + 0.0722 * Linearised(c[2]);
}

TEST(ColorScaleTest, SignIsSeenByEveryEyeBeyondTheTolerance) {
  const ColorScale scale = ColorScale::Signed(0.003);
  for (const auto& blindness : kColorBlindness) {
    for (double e = 0.003; e <= 0.06; e *= 1.3) {
      // Measured: smallest 31.
      EXPECT_GT(Difference(Seen(scale(e), blindness), Seen(scale(-e), blindness)), 20) << e;
    }
  }
}

TEST(ColorScaleTest, ThreeFiveAndTenMillimetresLookDifferent) {
  const ColorScale scale = ColorScale::Signed(0.003);
  const std::array<double, 9> normal = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  for (const double sign : {1.0, -1.0}) {
    EXPECT_GT(Difference(Seen(scale(sign * 0.002), normal), Seen(scale(sign * 0.0031), normal)),
              6);  // the step at the tolerance
    EXPECT_GT(Difference(Seen(scale(sign * 0.0031), normal), Seen(scale(sign * 0.005), normal)), 6);
    EXPECT_GT(Difference(Seen(scale(sign * 0.005), normal), Seen(scale(sign * 0.010), normal)), 6);
  }
}

TEST(ColorScaleTest, LightnessFallsWithSizeOnBothSides) {
  const ColorScale scale = ColorScale::Signed(0.002);
  for (const double sign : {1.0, -1.0}) {
    double last = 2;
    for (double e = 0.0; e <= 0.04; e += 0.0005) {
      const double luminance = Luminance(scale(sign * e));
      EXPECT_LE(luminance, last) << sign * e;
      last = luminance;
    }
  }
}

TEST(ColorScaleTest, LegendAndColoursAgree) {
  for (const ColorScale& scale : {ColorScale::Signed(0.003), ColorScale::Paper()}) {
    for (double position = 0.01; position < 1; position += 0.07)
      EXPECT_NEAR(scale.Position(scale.Difference(position)), position, 1e-12);
    double last = -1;
    for (const ColorScale::Tick& tick : scale.Ticks()) {
      EXPECT_GT(scale.Position(tick.difference_m), last);
      last = scale.Position(tick.difference_m);
    }
    EXPECT_DOUBLE_EQ(scale.Position(scale.Ticks().back().difference_m), 1.0);
  }
}

TEST(ColorScaleTest, FollowsThePaperWhereAsked) {
  const ColorScale scale = ColorScale::Paper();
  EXPECT_EQ(scale(0.0), (Color{0, 0, 255}));
  EXPECT_EQ(scale(0.10), (Color{255, 0, 0}));
  EXPECT_EQ(scale(-0.25), (Color{255, 0, 0}));
  EXPECT_EQ(scale(-0.05), scale(0.05));
}

TEST(ColorScaleTest, HolesAreGreyAndNoDifferenceIs) {
  const double nothing = std::numeric_limits<double>::quiet_NaN();
  for (const ColorScale& scale : {ColorScale::Signed(0.003), ColorScale::Paper()}) {
    EXPECT_EQ(scale(nothing), kHoleColor);
    for (double e = -0.12; e <= 0.12; e += 0.0001) EXPECT_NE(scale(e), kHoleColor);
  }
}

TEST(ColorScaleTest, RefusesAToleranceOfZero) {
  EXPECT_THROW((void)ColorScale::Signed(0), std::invalid_argument);
  EXPECT_THROW((void)ColorScale::Signed(std::numeric_limits<double>::quiet_NaN()),
               std::invalid_argument);
}

}  // namespace
}  // namespace plumb
