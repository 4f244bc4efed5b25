// SPDX-License-Identifier: Apache-2.0
// Markers under cameras with other tone curves than the one that detection expects.
#include "algo/markers/sweep_tone.hpp"

#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "tests/unit/markers/marker_scene.hpp"

namespace plumb {
namespace {

constexpr double kToneLength_m = 0.104;
constexpr int kNumMarkers = 24;

Intrinsics ToneCamera() {
  Intrinsics camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = camera.fy = 525;
  camera.cx = 319.5;
  camera.cy = 239.5;
  return camera;
}

struct Curve {
  std::string name;
  std::function<double(double)> encode;  // Light to value, both 0 to 1.
  double sigma_px = 0.03;                // Allowed mean inward error.
};

// What the renderer encoded by the sRGB curve, encoded by another.
cv::Mat Encoded(const cv::Mat& srgb, const Curve& curve) {
  cv::Mat table(1, 256, CV_8UC1);
  for (int i = 0; i < 256; ++i)
    table.at<std::uint8_t>(i) = cv::saturate_cast<std::uint8_t>(
        255 * curve.encode(SrgbTone()[static_cast<std::size_t>(i)]));
  cv::Mat encoded;
  cv::LUT(srgb, table, encoded);
  return encoded;
}

struct Sweep {
  std::vector<MarkerSighting> sightings;
  std::vector<ImageCorners> truth;
};

Sweep MakeSweep(const Curve& curve, double blur_px) {
  std::mt19937 random(17);
  const MarkerDictionary dictionary = MarkerDictionary::ByName("DICT_6X6_250");
  Sweep sweep;
  for (int id = 0; id < kNumMarkers; ++id) {
    const testing::PlacedMarker marker = testing::RandomMarker(id, 60, 40 * std::numbers::pi / 180,
                                                               kToneLength_m, ToneCamera(), random);
    testing::SceneLook look;
    look.blur_px = blur_px;
    look.noise = 1.0;
    const cv::Mat image =
        Encoded(testing::Render(dictionary, {marker}, ToneCamera(), look, random), curve);
    sweep.truth.push_back(testing::TrueCorners(marker, kToneLength_m, ToneCamera()));
    sweep.sightings.push_back({image, sweep.truth.back(), {dictionary.Code(id), 6}});
  }
  return sweep;
}

// Mean distance that the corners lie towards the marker's centre.
double Inward_px(const Sweep& sweep, const CornerRefinementOptions& options) {
  double sum = 0;
  int count = 0;
  for (std::size_t i = 0; i < sweep.sightings.size(); ++i) {
    const MarkerSighting& sighting = sweep.sightings[i];
    const ImageCorners& truth = sweep.truth[i];
    const auto refined = RefineCorners(sighting.gray, truth, sighting.pattern, options);
    if (!refined) continue;
    const Eigen::Vector2d centre = 0.25 * (truth[0] + truth[1] + truth[2] + truth[3]);
    for (std::size_t k = 0; k < 4; ++k, ++count)
      sum += (refined->corners[k] - truth[k]).dot((centre - truth[k]).normalized());
  }
  EXPECT_GT(count, 3 * kNumMarkers);
  return sum / count;
}

class SweepToneTest : public ::testing::TestWithParam<Curve> {};

TEST_P(SweepToneTest, CornersStayWhereTheyAreWhateverTheCurve) {
  const Sweep sweep = MakeSweep(GetParam(), 1.0);
  const auto tone = EstimateTone(sweep.sightings);
  ASSERT_TRUE(tone);
  CornerRefinementOptions found;
  found.tone = &tone->table;
  found.edge_shift_px = tone->edge_shift_px;
  const double inward_px = Inward_px(sweep, found);
  fmt::print(
      "{}: gamma {:.2f} +- {:.3f}, edge shift {:.3f} +- {:.3f} px; inward {:.3f} px, {:.3f} "
      "under sRGB\n",
      GetParam().name, tone->gamma, tone->sigma_gamma, tone->edge_shift_px,
      tone->sigma_edge_shift_px, inward_px, Inward_px(sweep, {}));
  EXPECT_NEAR(inward_px, 0.0, GetParam().sigma_px);
}

double Smooth(double x) { return x * x * (3 - 2 * x); }

INSTANTIATE_TEST_SUITE_P(
    Curves, SweepToneTest,
    ::testing::Values(Curve{"srgb",
                            [](double x) {
                              return x <= 0.0031308 ? 12.92 * x
                                                    : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
                            }},
                      Curve{"linear", [](double x) { return x; }},
                      Curve{"power_1_6", [](double x) { return std::pow(x, 1 / 1.6); }},
                      Curve{"power_2_8", [](double x) { return std::pow(x, 1 / 2.8); }},
                      Curve{"s_shaped",
                            [](double x) {
                              const double v = std::pow(x, 1 / 2.2);
                              return 0.6 * v + 0.4 * Smooth(v);
                            }}),
    [](const auto& curve) { return curve.param.name; });

TEST(SweepTone, AWrongCurveMovesCorners) {
  const Sweep sweep = MakeSweep({"linear", [](double x) { return x; }}, 1.0);
  EXPECT_LT(Inward_px(sweep, {}), -0.1) << "nothing to mend: nothing is tested";
}

TEST(SweepTone, TooFewOrTooSmallMarkersTellNothing) {
  Sweep sweep = MakeSweep({"linear", [](double x) { return x; }}, 1.0);
  sweep.sightings.resize(7);
  EXPECT_FALSE(EstimateTone(sweep.sightings));
  EXPECT_FALSE(EstimateTone({}));
}

}  // namespace
}  // namespace plumb
