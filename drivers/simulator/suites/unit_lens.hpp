// SPDX-License-Identifier: Apache-2.0
// Lenses of simulated colour cameras.
#pragma once

#include "algo/base/names.hpp"
#include "drivers/simulator/sensor/sensor_unit.hpp"

namespace plumb::simulated {

enum class LensKind : std::uint8_t { kPlain, kRational, kFisheye };

/// Gives the colour camera a lens of this kind, with the errors that the calibration of its plain
/// one has. The fisheye is Kannala and Brandt's itself, not the rational lens by which the method
/// replaces it; camera.yaml states the latter. The plain one is left as it is.
/// @param unit  At its final image size.
void GiveLens(SensorUnit& unit, LensKind kind);

}  // namespace plumb::simulated

template <>
inline constexpr auto plumb::kNamesOf<plumb::simulated::LensKind> =
    plumb::NamesUpTo<plumb::simulated::LensKind::kFisheye>({"plain", "rational", "fisheye"});
