// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/sensor/ps1080.hpp"

#include <array>
#include <cmath>

namespace plumb {

int Ps1080DepthOfCode(int code) {
  const double m = 0.1042 * ((code - 800) / 4.0 - 0.375);
  return static_cast<int>(std::trunc(9000.0 / (7.5 - m)));
}

int QuantisePs1080(double depth_mm) {
  static const std::array<int, 1024> kDepths = [] {
    std::array<int, 1024> depths{};
    for (std::size_t code = 0; code < depths.size(); ++code)
      depths[code] = Ps1080DepthOfCode(static_cast<int>(code));
    return depths;
  }();
  const double code = 800.0 + 4.0 * 0.375 + (7.5 - 9000.0 / depth_mm) * (4.0 / 0.1042);
  if (!(code >= 0 && code < static_cast<double>(kDepths.size() - 1)))
    return Ps1080DepthOfCode(static_cast<int>(std::lround(code)));
  return kDepths[static_cast<std::size_t>(code + 0.5)];
}

}  // namespace plumb
