// SPDX-License-Identifier: Apache-2.0
// Judges a sensor and its room by sweeps of something that did not move: every number in a
// comparison of two of them is an error.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "algo/verdict/gates.hpp"

namespace plumb {

/// One sweep.
struct RepeatedSweep {
  std::string name;
  /// Chi-square of its calibration against what was known before, for each term; not set where
  /// nothing was calibrated.
  std::optional<double> chi2_per_term = {};
};

/// Two of the sweeps, compared.
struct RepeatedPair {
  std::size_t reference = 0, current = 0;  ///< Indices of the sweeps.
  Verdict verdict = Verdict::kNoAnswer;
  std::vector<Message> reasons = {};  ///< Why there is no answer.
  /// As far as they are known; there may be some without an answer, too.
  std::array<std::optional<MeasuredNumber>, 6> numbers = {};
};

struct Repeatability {
  /// Standard deviation of one sweep's number, in mm and degrees, around the mean of all: the root
  /// mean square difference of two, divided by the square root of 2. Not set where no pair has it.
  std::array<std::optional<double>, 6> scatter = {};
  int held = 0;                       ///< Intervals of 95 % that contain the truth, which is 0.
  int judged = 0;                     ///< Intervals in all.
  std::vector<Message> reasons = {};  ///< Why sensor and room are not fit; empty if they are.

  [[nodiscard]] bool is_fit() const { return reasons.empty(); }
};

/// A sensor and a room are fit if every pair has an answer and none of them is MOVE, if the
/// intervals hold as often as they should, and if the calibrations stay where they are expected.
[[nodiscard]] Repeatability JudgeRepeats(const std::vector<RepeatedSweep>& sweeps,
                                         const std::vector<RepeatedPair>& pairs);

}  // namespace plumb
