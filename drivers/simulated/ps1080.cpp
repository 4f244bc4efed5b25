#include "drivers/simulated/ps1080.hpp"

#include <cmath>

namespace plumb {

int Ps1080DepthOfCode(int code) {
  const double m = 0.1042 * ((code - 800) / 4.0 - 0.375);
  return static_cast<int>(std::trunc(9000.0 / (7.5 - m)));
}

int QuantisePs1080(double depth_mm) {
  const double code = 800.0 + 4.0 * ((7.5 - 9000.0 / depth_mm) / 0.1042 + 0.375);
  return Ps1080DepthOfCode(static_cast<int>(std::lround(code)));
}

}  // namespace plumb
