// The six numbers of a correction against the truth: does the stated 95 % hold, does the verdict?
#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "algo/acceptance/acceptance.hpp"
#include "algo/base/pose.hpp"
#include "algo/comparison/correction.hpp"

namespace plumb {

/// One of the six numbers beside its true value; mm or degrees.
struct NumberError {
  double value = 0.0;
  double truth = 0.0;
  double u95 = 0.0;  ///< Stated 95 % half-width.
  /// The true value lies in the stated interval, its ends included.
  [[nodiscard]] bool IsInside() const;
};

/// In the order of kNumberNames; absent where the number is refused.
using NumberErrors = std::array<std::optional<NumberError>, 6>;

/// The six true values, mm and degrees, in the order of kNumberNames.
using TrueNumbers = std::array<double, 6>;

/// @param true_motion  p_current = true_motion * p_reference, in the true reference-marker frame.
[[nodiscard]] TrueNumbers TrueNumbersOf(const Pose& true_motion, const Eigen::Vector3d& isocentre_m,
                                        const Pose& T_iec_reference);

[[nodiscard]] NumberErrors ErrorsOfNumbers(const Correction& correction, const TrueNumbers& truth);

/// How often the truth lay in the stated interval.
struct IntervalCount {
  std::size_t count = 0;
  std::size_t inside = 0;
  [[nodiscard]] double Fraction() const;  ///< 0 where nothing was counted.
};

/// Over the pairs that got an answer.
struct IntervalCoverage {
  std::array<IntervalCount, 6> numbers;  ///< In the order of kNumberNames.
  IntervalCount all;                     ///< Over all numbers together.
  void Add(const NumberErrors& errors);
};

/// Verdicts against what is true. A pair is truly in if all six true values lie within their
/// tolerances, and well in if they do so by at least 1.5 mm and 0.5 deg.
struct VerdictCount {
  std::size_t in_tolerance = 0, unsure = 0, move = 0, no_answer = 0;
  std::size_t truly_in = 0, truly_out = 0, well_in = 0;
  std::size_t false_in_tolerance = 0;  ///< Called in tolerance, truly out: must be none.
  std::size_t false_move = 0;          ///< Called move, truly in.
  std::size_t found_in = 0;            ///< Called in tolerance, truly in.
  std::size_t found_well_in = 0;       ///< Called in tolerance, well in.
  void Add(Verdict verdict, const TrueNumbers& truth, const AcceptanceLimits& limits);
};
inline constexpr double kWellInShift_mm = 1.5;
inline constexpr double kWellInRotation_deg = 0.5;

}  // namespace plumb
