// SPDX-License-Identifier: Apache-2.0
#include "algo/monitoring/advice.hpp"

#include <algorithm>
#include <cmath>

#include "algo/base/statistics.hpp"

namespace plumb {
namespace {

constexpr double kEnter_s = 1.0;
constexpr int kMostUnsureFrames = 1;
// `in` is said ten times a second for minutes: one frame in forty would be too often.
constexpr double kThreeSigmas = 3.0 / kCover95;

NumberJudgement Worst(const LiveNumbers& numbers, const AcceptanceLimits& limits) {
  auto worst = NumberJudgement::kWithin;
  for (Eigen::Index i = 0; i < 6; ++i) {
    const double tolerance = i < 3 ? limits.shift_tolerance_m : limits.rotation_tolerance_rad;
    const NumberJudgement judged =
        JudgeNumber(numbers.value[i], kThreeSigmas * numbers.u95[i], tolerance);
    if (judged == NumberJudgement::kUnjudged) return judged;
    worst = std::max(worst, judged);
  }
  return worst;
}

}  // namespace

LiveAdvice AdviceFilter::Next(double time_s, const std::optional<LiveNumbers>& numbers) {
  const bool gap = last_s_ && time_s - *last_s_ > kLongestGap_s;
  last_s_ = time_s;
  const NumberJudgement judged =
      numbers && !gap ? Worst(*numbers, limits_) : NumberJudgement::kUnjudged;
  if (judged == NumberJudgement::kUnjudged) {
    inside_since_s_.reset();
    unsure_frames_ = 0;
    now_ = LiveAdvice::kUnknown;
    return now_;
  }
  unsure_frames_ = judged == NumberJudgement::kUnsure ? unsure_frames_ + 1 : 0;
  const bool leaves = judged == NumberJudgement::kOutside ||
                      (judged == NumberJudgement::kUnsure &&
                       (now_ != LiveAdvice::kIn || unsure_frames_ > kMostUnsureFrames));
  if (leaves) {
    inside_since_s_.reset();
    now_ = LiveAdvice::kOut;
    return now_;
  }
  if (!inside_since_s_) inside_since_s_ = time_s;
  if (time_s - *inside_since_s_ >= kEnter_s) now_ = LiveAdvice::kIn;
  return now_;
}

}  // namespace plumb
