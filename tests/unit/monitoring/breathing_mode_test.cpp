// SPDX-License-Identifier: Apache-2.0
#include "algo/monitoring/breathing_mode.hpp"

#include <random>

#include <gtest/gtest.h>

#include "algo/base/units.hpp"
#include "tests/unit/monitoring/small_view.hpp"

namespace plumb {
namespace {

constexpr double kRate_hz = 15.0;

class BreathingModeTest : public testing::Test {
 protected:
  /// Eight seconds of a surface whose middle rises, as wide as a belly, with white noise of a
  /// millimetre. (Of a bump of half that width, three blocks' mean shows 6 of 8 mm.)
  [[nodiscard]] BlockSeries Series(double size_m, double period_s) const {
    std::mt19937 random(3);
    std::normal_distribution<float> noise(0.0F, 0.001F);
    const BlockImage still = test::Seen(test::BumpyMesh(), grid_);
    BlockSeries series;
    for (int k = 0; k < 8 * kRate_hz; ++k) {
      series.time_s.push_back(k / kRate_hz);
      const double rise_m =
          size_m * std::pow(std::sin(3.14159265 * (k / kRate_hz + 0.7) / period_s), 4);
      std::vector<float> frame = still.inverse_depth;
      for (std::size_t b = 0; b < frame.size(); ++b) {
        if (frame[b] <= 0) continue;
        const auto nearer =
            static_cast<float>(rise_m * std::exp(-model_.point[b].head<2>().squaredNorm() / 0.04F));
        frame[b] = 1.0F / (1.0F / frame[b] - nearer + noise(random));
      }
      series.inverse_depth.push_back(std::move(frame));
    }
    return series;
  }
  [[nodiscard]] std::optional<BreathingMode> Learn(const BlockSeries& series) const {
    return LearnBreathing(series, model_, grid_, test::CameraOfScene().inverse(),
                          Eigen::Vector3d::UnitZ());
  }

  BlockGrid grid_{test::SmallCamera()};
  ViewModel model_ = test::ModelOf(test::Seen(test::BumpyMesh(), grid_), grid_);
};

TEST_F(BreathingModeTest, FindsPeriodAndAmplitudeAtAnyPhase) {
  for (const double period_s : {3.1, 4.0, 5.4}) {
    const auto mode = Learn(Series(0.008, period_s));
    ASSERT_TRUE(mode) << period_s;
    EXPECT_NEAR(mode->period_s, period_s, 0.2);
    EXPECT_NEAR(mode->amplitude_m, 0.008, 1.2 * kMillimetre);
    const auto [begin, end] = mode->last_breath;
    EXPECT_NEAR(static_cast<double>(end - begin) / kRate_hz, period_s, 0.2);
    EXPECT_EQ(end, mode->sizes_m.size()) << "the last whole breath";
    EXPECT_TRUE(mode->lag.empty()) << "everything rises together";
  }
}

TEST_F(BreathingModeTest, ItIsSureOnlyWhereALongerBreathWasPossible) {
  const auto after = [&](double period_s, double length_s) {
    BlockSeries series = Series(0.008, period_s);
    const auto frames = static_cast<std::size_t>(length_s * kRate_hz);
    series.time_s.resize(frames);
    series.inverse_depth.resize(frames);
    const auto mode = Learn(series);
    return mode && mode->is_whole;
  };
  EXPECT_TRUE(after(3.1, 5.8));
  EXPECT_FALSE(after(3.1, 4.9)) << "two seconds to compare it with, and some";
  EXPECT_FALSE(after(5.4, 6.0)) << "a part of a breath is none";
  EXPECT_TRUE(after(5.4, 8.0));
}

TEST_F(BreathingModeTest, ASurfaceAtRestDoesNotBreathe) { EXPECT_FALSE(Learn(Series(0.0, 4.0))); }

TEST_F(BreathingModeTest, TheMeanLeavesOutWhatWasHardlySeen) {
  BlockSeries series{.time_s = {0, 1, 2, 3},
                     .inverse_depth = {{1, 1}, {1.2F, 0}, {1.1F, 0}, {0, 0}}};
  const std::vector<float> mean = MeanOf(series, {0, 4});
  EXPECT_NEAR(mean[0], 1.1F, 1e-6F);
  EXPECT_EQ(mean[1], 0.0F);
}

}  // namespace
}  // namespace plumb
