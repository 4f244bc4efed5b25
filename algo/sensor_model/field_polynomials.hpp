// The polynomials of the depth distortion field in one column and in one row, whose cells share
// them.
#pragma once

#include <array>

#include "algo/sensor_model/depth_field.hpp"

namespace plumb {

using FieldAcross = std::array<double, 6>;  ///< T_0(x) to T_5(x)
using FieldDown = std::array<double, 5>;    ///< T_0(y) to T_4(y)

/// The polynomials of one of the CentredCoordinates().
[[nodiscard]] FieldAcross PolynomialsAcross(double centred_x);
[[nodiscard]] FieldDown PolynomialsDown(double centred_y);

/// FieldProducts() where the column and the row meet.
[[nodiscard]] FieldRow FieldProducts(const FieldAcross& across, const FieldDown& down);

}  // namespace plumb
