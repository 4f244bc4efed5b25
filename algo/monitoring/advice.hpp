// SPDX-License-Identifier: Apache-2.0
// Whether the body is where it should be, frame by frame: `unknown` counts as hold.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "algo/base/names.hpp"
#include "algo/base/pose.hpp"
#include "algo/verdict/gates.hpp"

namespace plumb {

enum class LiveAdvice : std::uint8_t { kIn, kOut, kUnknown };
template <>
inline constexpr auto kNamesOf<LiveAdvice> = NamesUpTo<LiveAdvice::kUnknown>({"in", "out",
                                                                              "unknown"});

/// Six numbers with their uncertainty, in the order of couch::Component, metres and radians.
struct LiveNumbers {
  Vector6d value = Vector6d::Zero();
  Vector6d u95 = Vector6d::Zero();  ///< Half-widths of the 95 % intervals.
};

/// The advice with its hysteresis: `in` after one second in which every number with its uncertainty
/// (three standard deviations) was within its tolerance; left at once where a number is outside,
/// and after two frames where one is not surely inside. Where the numbers are unknown, so is the
/// advice.
class AdviceFilter {
 public:
  explicit AdviceFilter(const AcceptanceLimits& limits) : limits_(limits) {}

  /// @param time_s  Of the frame, later than the one before.
  /// @param numbers Not set: unknown.
  [[nodiscard]] LiveAdvice Next(double time_s, const std::optional<LiveNumbers>& numbers);

 private:
  AcceptanceLimits limits_;
  LiveAdvice now_ = LiveAdvice::kUnknown;
  std::optional<double> inside_since_s_;
  std::optional<double> last_s_;
  int unsure_frames_ = 0;
};

/// A longer time without a frame is a time of which nothing is known.
inline constexpr double kLongestGap_s = 0.15;

}  // namespace plumb
