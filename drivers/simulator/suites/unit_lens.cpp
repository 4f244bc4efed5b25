// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/suites/unit_lens.hpp"

#include <optional>
#include <stdexcept>

#include "drivers/replay/lens_model.hpp"
#include "drivers/simulator/world/random.hpp"

namespace plumb::simulated {
namespace {

std::array<double, 8> FittedTo(const std::array<double, 4>& lens, const Intrinsics& camera) {
  const std::optional<std::array<double, 8>> fitted = RationalOfEquidistant(lens, camera);
  if (!fitted) throw std::logic_error("the simulated fisheye lens sees too far to the side");
  return *fitted;
}

}  // namespace

void GiveLens(SensorUnit& unit, LensKind kind) {
  if (kind == LensKind::kPlain) return;
  Intrinsics& real = unit.color_true;
  Intrinsics& written = unit.color_written;
  RandomStream random(Hash(unit.seed, 134));
  const auto error = [&](std::size_t term) {
    return real.distortion[term] == 0 ? 1.0 : written.distortion[term] / real.distortion[term];
  };
  const std::array<double, 2> errors = {error(0), error(1)};
  if (kind == LensKind::kRational) {
    // As makers state it for the colour camera of an Azure Kinect.
    const double k1 = 0.5 + random.Within(0.1), k2 = -2.7 + random.Within(0.2);
    real.distortion[0] = k1;
    real.distortion[1] = k2;
    real.distortion[4] = 1.5 + random.Within(0.1);
    // The denominator follows the numerator, so that the lens bends rays by some per cent only.
    real.distortion[5] = k1 - 0.11 + random.Within(0.02);
    real.distortion[6] = k2 + 0.2 + random.Within(0.02);
    real.distortion[7] = real.distortion[4] - 0.07;
    const std::array<double, 2> decentred = {written.distortion[2], written.distortion[3]};
    written.distortion = real.distortion;
    // A calibration finds the ratio of the two polynomials, hardly each of them: the plain lens's
    // errors of some per cent are small parts of these large terms.
    written.distortion[0] += 0.055 * (errors[0] - 1.0);
    written.distortion[1] -= 0.17 * (errors[1] - 1.0);
    written.distortion[2] = decentred[0];
    written.distortion[3] = decentred[1];
    return;
  }
  const std::array<double, 4> lens = {0.03 + random.Within(0.02), -0.01 + random.Within(0.005), 0.0,
                                      0.0};
  unit.color_lens_rest.equidistant = lens;
  real.distortion = FittedTo(lens, real);
  written.distortion = FittedTo({lens[0] * errors[0], lens[1] * errors[1], 0.0, 0.0}, written);
}

}  // namespace plumb::simulated
