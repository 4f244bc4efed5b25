// SPDX-License-Identifier: Apache-2.0
// The noise of a depth camera: the default to the bit, what may be stated, and what holds for it.
#include "algo/sensor_model/depth_noise.hpp"

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/map/dense_view.hpp"
#include "algo/surface/view_surface.hpp"
#include "words/sensor.hpp"

namespace plumb {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

// Nguyen's model as it was written before a sensor could state its own, in both precisions.
double FormerSigma(double z_m, double grazing) {
  return 0.0012 + 0.0019 * (z_m - 0.4) * (z_m - 0.4) +
         0.0001 / std::sqrt(std::max(z_m, 0.1)) * grazing * grazing;
}
float FormerSigmaOfSurfaces(float depth_m, float cos_incidence) {
  const float off = depth_m - 0.4F;
  float sigma = 0.0012F + 0.0019F * off * off;
  if (cos_incidence < 1.0F) {
    constexpr float kRightAngle = std::numbers::pi_v<float> / 2.0F;
    const float angle = std::acos(std::max(cos_incidence, 0.02F));
    const float ratio = angle / (kRightAngle - angle);
    sigma += 0.0001F / std::sqrt(depth_m) * ratio * ratio;
  }
  return sigma;
}

std::string FaultText(const DepthNoise& noise) {
  const std::optional<Message> fault = FaultOf(noise);
  return fault ? fault->English() : "none";
}

TEST(DepthNoiseTest, TheDefaultGivesTheFormerValuesToTheBit) {
  const DepthNoise noise;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> depth_m(0.1, 12.0), cosine(0.0, 1.0);
  for (int i = 0; i < 100000; ++i) {
    const double z_m = depth_m(random), c = i % 10 == 0 ? 1.0 : cosine(random);
    ASSERT_EQ(DepthSigma(noise, z_m, c), FormerSigma(z_m, Grazing(c))) << z_m << ", " << c;
    const auto z = static_cast<float>(z_m), cos_incidence = static_cast<float>(c);
    ASSERT_EQ(AxialSigma(noise, z, cos_incidence), FormerSigmaOfSurfaces(z, cos_incidence))
        << z << ", " << cos_incidence;
    ASSERT_EQ(noise.SigmaFacing_m(z), FormerSigmaOfSurfaces(z, 1.0F)) << z;
  }
}

TEST(DepthNoiseTest, IsThePolynomialAboutItsOriginPlusTheShareOfTheIncidence) {
  const DepthNoise noise = {.constant_m = 0.002,
                            .linear_m_per_m = 0.003,
                            .quadratic_m_per_m2 = 0.004,
                            .origin_m = 0.5,
                            .grazing_m = 0.0005};
  EXPECT_NEAR(noise.SigmaFacing_m(0.5), 0.002, 1e-15);
  EXPECT_NEAR(noise.SigmaFacing_m(2.5), 0.002 + 0.003 * 2 + 0.004 * 4, 1e-15);
  EXPECT_NEAR(noise.Sigma_m(4.0, 1.0), noise.SigmaFacing_m(4.0) + 0.0005 / 2, 1e-15);
  EXPECT_NEAR(noise.Sigma_m(4.0, 2.0), noise.SigmaFacing_m(4.0) + 4 * 0.0005 / 2, 1e-15);
  EXPECT_NEAR(DepthSigma(noise, 1.0, std::sqrt(0.5)), noise.SigmaFacing_m(1.0) + 0.0005, 1e-15);
}

TEST(DepthNoiseTest, EveryValueIsAcceptedAtItsLimitsAndRefusedBeyond) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const auto check = [](const char* name, double DepthNoise::*member, double inside, double outside,
                        const DepthNoise& others) {
    DepthNoise noise = others;
    noise.*member = inside;
    EXPECT_FALSE(FaultOf(noise).has_value()) << name << " " << inside << FaultText(noise);
    for (const double bad : {outside, std::nan(""), kInfinity, -kInfinity}) {
      noise.*member = bad;
      EXPECT_THAT(FaultText(noise),
                  AllOf(HasSubstr(std::string(name) + " is"), HasSubstr("expected")));
    }
  };
  const auto beyond = [](double limit, double towards) { return std::nextafter(limit, towards); };
  // The other values keep the sum within its own limits.
  check("constant_m", &DepthNoise::constant_m, 0.1, beyond(0.1, 1),
        {.quadratic_m_per_m2 = 0.0, .origin_m = 0.0});
  // The limit at 1 m keeps a slope far from its own limit.
  check("linear_m_per_m", &DepthNoise::linear_m_per_m, 0.099, beyond(1.0, 2),
        {.constant_m = 0.001, .quadratic_m_per_m2 = 0.0, .origin_m = 0.0});
  check("quadratic_m_per_m2", &DepthNoise::quadratic_m_per_m2, 1.0, beyond(1.0, 2),
        {.origin_m = 1.0});
  check("quadratic_m_per_m2", &DepthNoise::quadratic_m_per_m2, 0.0, -1e-300, {});
  check("origin_m", &DepthNoise::origin_m, 10.0, beyond(10.0, 20), {.quadratic_m_per_m2 = 1e-4});
  check("origin_m", &DepthNoise::origin_m, 0.0, -1e-300, {});
  check("grazing_m", &DepthNoise::grazing_m, 0.1, beyond(0.1, 1), {});
  check("grazing_m", &DepthNoise::grazing_m, 0.0, -1e-300, {});
}

TEST(DepthNoiseTest, NothingBelowTheSmallestNoiseIsAccepted) {
  DepthNoise noise = {.quadratic_m_per_m2 = 0.0, .origin_m = 0.0};
  noise.constant_m = kLeastDepthNoise_m;
  EXPECT_EQ(FaultOf(noise), std::nullopt);
  noise.constant_m = std::nextafter(kLeastDepthNoise_m, 0);
  EXPECT_THAT(FaultText(noise), HasSubstr("falls to"));
  // It decreases with the distance without end.
  noise = {.constant_m = 0.1, .linear_m_per_m = -1e-6, .quadratic_m_per_m2 = 0.0};
  EXPECT_THAT(FaultText(noise), HasSubstr("falls to -inf"));
  noise.quadratic_m_per_m2 = 1e-320;
  EXPECT_THAT(FaultText(noise), HasSubstr("falls to"));
  // Smallest at 2 m, where it is constant_m - linear^2 / (4 quadratic) = 0.0001, and then 0.
  noise = {
      .constant_m = 0.0041, .linear_m_per_m = -0.004, .quadratic_m_per_m2 = 0.001, .origin_m = 0.0};
  EXPECT_EQ(FaultOf(noise), std::nullopt);
  noise.constant_m = 0.004;
  EXPECT_THAT(FaultText(noise), HasSubstr("falls to"));
  // Its smallest value lies behind the camera, where nothing is measured.
  noise = {
      .constant_m = 0.0001, .linear_m_per_m = 0.01, .quadratic_m_per_m2 = 0.001, .origin_m = 0};
  EXPECT_EQ(FaultOf(noise), std::nullopt);
  noise.origin_m = 0.1;
  EXPECT_THAT(FaultText(noise), HasSubstr("falls to"));
}

TEST(DepthNoiseTest, MillimetresAreRefused) {
  DepthNoise noise = {.constant_m = 0.05, .quadratic_m_per_m2 = 0.05, .origin_m = 0.0};
  EXPECT_EQ(FaultOf(noise), std::nullopt);
  noise.quadratic_m_per_m2 = 0.0501;
  EXPECT_THAT(FaultText(noise), HasSubstr("at 1 m"));
  EXPECT_THAT(FaultText({.constant_m = 1.2}), HasSubstr("constant_m is 1.2"));
}

// Whatever is accepted can be divided by at every distance, in both precisions, and grows with the
// incidence; whatever is refused as too small is too small somewhere.
TEST(DepthNoiseTest, WhateverIsAcceptedIsPositiveAndFiniteEverywhere) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> exponent(-7, 0.5), unit(0, 1);
  const auto value = [&](double most) {
    return unit(random) < 0.2 ? 0.0 : most * std::pow(10, exponent(random));
  };
  int num_accepted = 0, num_too_small = 0;
  for (int i = 0; i < 20000; ++i) {
    const DepthNoise noise = {.constant_m = value(0.1) * (unit(random) < 0.2 ? -1 : 1),
                              .linear_m_per_m = value(1.0) * (unit(random) < 0.5 ? -1 : 1),
                              .quadratic_m_per_m2 = value(1.0),
                              .origin_m = value(10.0),
                              .grazing_m = value(0.1)};
    const std::optional<Message> fault = FaultOf(noise);
    num_accepted += fault ? 0 : 1;
    double smallest_m = 1e9;
    for (double z_m = 0.0; z_m < 70.0; z_m = 1.05 * z_m + 0.001) {
      const double sigma_m = noise.SigmaFacing_m(z_m);
      smallest_m = std::min(smallest_m, sigma_m);
      if (fault) continue;
      const auto z = static_cast<float>(z_m);
      ASSERT_GE(sigma_m, 0.999 * kLeastDepthNoise_m) << "at " << z_m;
      ASSERT_GE(noise.SigmaFacing_m(z), 0.99F * static_cast<float>(kLeastDepthNoise_m)) << z_m;
      ASSERT_TRUE(std::isfinite(1.0F / (noise.SigmaFacing_m(z) * noise.SigmaFacing_m(z)))) << z_m;
      ASSERT_GE(noise.Sigma_m(z_m, 1.0), sigma_m);
      ASSERT_GE(noise.Sigma_m(z_m, 5.0), noise.Sigma_m(z_m, 1.0));
      ASSERT_TRUE(std::isfinite(noise.Sigma_m(z, 80.0F))) << z_m;
    }
    if (!fault) continue;
    EXPECT_FALSE(fault->empty());
    if (!fault->Is(say::sensor::kNoiseFalls) ||
        fault->English().find("-inf") != std::string::npos)  // may be too small far away only
      continue;
    ++num_too_small;
    const double vertex_m = noise.origin_m - noise.linear_m_per_m / (2 * noise.quadratic_m_per_m2);
    if (vertex_m > 0) smallest_m = std::min(smallest_m, noise.SigmaFacing_m(vertex_m));
    EXPECT_LT(smallest_m, 1.001 * kLeastDepthNoise_m) << fault->English();
  }
  EXPECT_GT(num_accepted, 1000) << "otherwise nothing is tested";
  EXPECT_GT(num_too_small, 1000);
}

}  // namespace
}  // namespace plumb
