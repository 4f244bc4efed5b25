// SPDX-License-Identifier: Apache-2.0
#include "algo/sensor_model/depth_noise.hpp"

#include <array>

#include "words/sensor.hpp"

namespace plumb {
namespace {

struct Range {
  const char* name;
  double value, least, most;
};

/// The polynomial's smallest value from z = 0 on; -infinity if it falls without end. It is convex,
/// because its quadratic coefficient is not negative.
double SmallestFacing_m(const DepthNoise& noise) {
  const double at_camera_m = noise.SigmaFacing_m(0.0);
  if (noise.quadratic_m_per_m2 == 0.0) return noise.linear_m_per_m < 0.0 ? -HUGE_VAL : at_camera_m;
  const double off_m = -noise.linear_m_per_m / (2.0 * noise.quadratic_m_per_m2);
  if (noise.origin_m + off_m <= 0.0) return at_camera_m;
  // At the vertex; written so that a tiny quadratic coefficient gives -infinity and not NaN.
  return noise.constant_m + 0.5 * noise.linear_m_per_m * off_m;
}

}  // namespace

std::optional<Message> FaultOf(const DepthNoise& noise) {
  const std::array<Range, 5> ranges = {{
      {"constant_m", noise.constant_m, -0.1, 0.1},
      {"linear_m_per_m", noise.linear_m_per_m, -1.0, 1.0},
      {"quadratic_m_per_m2", noise.quadratic_m_per_m2, 0.0, 1.0},
      {"origin_m", noise.origin_m, 0.0, 10.0},
      {"grazing_m", noise.grazing_m, 0.0, 0.1},
  }};
  for (const Range& range : ranges) {
    if (!(range.value >= range.least && range.value <= range.most))
      return say::sensor::NoiseOutOfRange(range.name, range.value, range.least, range.most);
  }
  if (const double smallest_m = SmallestFacing_m(noise); !(smallest_m >= kLeastDepthNoise_m))
    return say::sensor::NoiseFalls(smallest_m, kLeastDepthNoise_m);
  if (const double at_1m_m = noise.SigmaFacing_m(1.0); !(at_1m_m <= kMostDepthNoiseAt1m_m))
    return say::sensor::NoiseTooLarge(at_1m_m, kMostDepthNoiseAt1m_m);
  return std::nullopt;
}

}  // namespace plumb
