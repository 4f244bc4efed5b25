// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/sensor/other_projector.hpp"

#include <cmath>
#include <numbers>

#include "algo/base/units.hpp"
#include "drivers/simulator/sensor/noise_field.hpp"
#include "drivers/simulator/world/random.hpp"

namespace plumb::simulated {
namespace {

constexpr double kPatch_px = 6.0;   // of 640 columns: the size of a window that is matched
constexpr double kBeat_hz = 0.7;    // between the two sensors' frame rates
constexpr float kLost = 1.04F;      // of unit variance: 15 % of the pixels (Maimone & Fuchs 2012)
constexpr float kSometimes = 0.3F;  // by so much the border of what is lost moves with the beat
constexpr float kWrong = 1.0F;      // 32 % of the others, 27 % of all
constexpr double kMost_m = 3.0 * kMillimetre;  // Boehm 2012: 1 to 3 mm

}  // namespace

OtherProjector::OtherProjector(std::uint64_t seed, int width, int height)
    : lost_(CorrelatedNoise(Hash(seed, 151), width, height, kPatch_px * width / 640.0)),
      wrong_(CorrelatedNoise(Hash(seed, 152), width, height, 2.0 * kPatch_px * width / 640.0)) {}

void OtherProjector::Disturb(double time_s, cv::Mat& depth_m) const {
  const auto beat = static_cast<float>(std::sin(2.0 * std::numbers::pi * kBeat_hz * time_s));
  std::size_t i = 0;
  for (int row = 0; row < depth_m.rows; ++row) {
    float* depth = depth_m.ptr<float>(row);
    for (int column = 0; column < depth_m.cols; ++column, ++i) {
      if (depth[column] <= 0) continue;
      if (lost_[i] > kLost + kSometimes * beat) {
        depth[column] = 0;
      } else if (std::abs(wrong_[i]) > kWrong) {
        // Half of it always, half of it with the beat.
        const float share = 0.5F * (1.0F + beat) * std::copysign(1.0F, wrong_[i]);
        depth[column] += static_cast<float>(kMost_m) * share;
      }
    }
  }
}

}  // namespace plumb::simulated
