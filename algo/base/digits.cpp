// SPDX-License-Identifier: Apache-2.0
#include "algo/base/digits.hpp"

#include <fmt/format.h>

namespace plumb {
namespace {

std::string WithDecimal(std::string number, char decimal) {
  std::replace(number.begin(), number.end(), '.', decimal);
  return number;
}

}  // namespace

ShownNumber Shown(double value, double u95, int most, char decimal) {
  const int digits = DecimalsFor(u95, most);
  const std::string size = fmt::format("{:.{}f}", std::abs(value), digits);
  ShownNumber shown{.value = WithDecimal(size, decimal),
                    .u95 = {},
                    .is_zero = size.find_first_not_of("0.") == std::string::npos};
  if (!shown.is_zero) shown.value.insert(0, value < 0 ? "\u2212" : "+");
  if (!(u95 > 0)) return shown;
  const std::string half = fmt::format("{:.3f}", u95);
  const std::size_t first = half.find_first_not_of("0.");
  const bool begins_with_1 = first != std::string::npos && half[first] == '1';
  const int half_digits = std::min(most, digits + (begins_with_1 ? 1 : 0));
  // A small uncertainty is never shown as 0.
  const double least = std::pow(10.0, -half_digits);
  shown.u95 = WithDecimal(fmt::format("{:.{}f}", std::max(u95, least), half_digits), decimal);
  return shown;
}

std::string ValueWithUncertainty(double value, double u95, int most, char decimal) {
  const ShownNumber shown = Shown(value, u95, most, decimal);
  return shown.u95.empty() ? shown.value : shown.value + " \u00b1" + shown.u95;
}

std::string PlainNumber(double value, char decimal) {
  return WithDecimal(fmt::format("{:g}", value), decimal);
}

}  // namespace plumb
