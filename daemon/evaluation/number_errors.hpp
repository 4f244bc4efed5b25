// SPDX-License-Identifier: Apache-2.0
// The six numbers of a correction against the truth: coverage of the 95 % intervals and correctness
// of the verdicts.
#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "algo/base/pose.hpp"
#include "algo/comparison/correction.hpp"
#include "algo/verdict/gates.hpp"

namespace plumb {

/// One of the six numbers with its true value; mm or degrees.
struct NumberError {
  double value = 0.0;
  double truth = 0.0;
  double u95 = 0.0;  ///< Stated 95 % half-width.
  /// The true value lies in the stated interval, including its ends.
  [[nodiscard]] bool IsInside() const;
};

/// In the order of kNumberNames; absent if the number is not reported.
using NumberErrors = std::array<std::optional<NumberError>, 6>;

/// The six true values, mm and degrees, in the order of kNumberNames.
using TrueNumbers = std::array<double, 6>;

/// @param true_motion  p_current = true_motion * p_reference, in the true reference-marker frame.
[[nodiscard]] TrueNumbers TrueNumbersOf(const Pose& true_motion, const Eigen::Vector3d& isocentre_m,
                                        const Pose& T_iec_reference);

[[nodiscard]] NumberErrors ErrorsOfNumbers(const Correction& correction, const TrueNumbers& truth);

/// How often the truth was in the stated interval.
struct IntervalCount {
  std::size_t count = 0;
  std::size_t inside = 0;
  [[nodiscard]] double Fraction() const;  ///< 0 without counts.
};

/// Over the pairs with an answer.
struct IntervalCoverage {
  std::array<IntervalCount, 6> numbers;  ///< In the order of kNumberNames.
  IntervalCount all;                     ///< Over all numbers together.
  void Add(const NumberErrors& errors);
};

/// Verdicts against the truth. A pair is truly in if all six true values are within their
/// tolerances, and well in if they are so by at least 1.5 mm and 0.5 deg.
struct VerdictCount {
  std::size_t in_tolerance = 0, unsure = 0, move = 0, no_answer = 0;
  std::size_t truly_in = 0, truly_out = 0, well_in = 0;
  std::size_t false_in_tolerance = 0;  ///< Verdict in tolerance, but truly out: must be none.
  std::size_t false_move = 0;          ///< Verdict move, but truly in.
  std::size_t found_in = 0;            ///< Verdict in tolerance, truly in.
  std::size_t found_well_in = 0;       ///< Verdict in tolerance, well in.
  void Add(Verdict verdict, const TrueNumbers& truth, const AcceptanceLimits& limits);
};
inline constexpr double kWellInShift_mm = 1.5;
inline constexpr double kWellInRotation_deg = 0.5;

}  // namespace plumb
