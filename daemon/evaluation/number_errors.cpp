// SPDX-License-Identifier: Apache-2.0
#include "daemon/evaluation/number_errors.hpp"

#include <cmath>

#include "algo/base/units.hpp"

namespace plumb {
namespace {

std::array<std::optional<double>, 6> InOrder(const CouchNumbers& n) {
  return {n.vertical_mm, n.longitudinal_mm, n.lateral_mm, n.pitch_deg, n.roll_deg, n.yaw_deg};
}

// Whether every true value is within its tolerance by at least the margin.
bool LiesWithin(const TrueNumbers& truth, const AcceptanceLimits& limits, double margin_mm,
                double margin_deg) {
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const double margin = IsShift(i) ? margin_mm : margin_deg;
    if (!(std::abs(truth[i]) <= ToleranceOf(limits, i) - margin)) return false;
  }
  return true;
}

}  // namespace

bool NumberError::IsInside() const { return std::abs(value - truth) <= u95; }

double IntervalCount::Fraction() const {
  return count > 0 ? static_cast<double>(inside) / static_cast<double>(count) : 0.0;
}

TrueNumbers TrueNumbersOf(const Pose& true_motion, const Eigen::Vector3d& isocentre_m,
                          const Pose& T_iec_reference) {
  const Vector6d couch = CouchVector(true_motion, isocentre_m, T_iec_reference);
  return {couch[2] / kMillimetre, couch[1] / kMillimetre, couch[0] / kMillimetre,
          couch[3] / kDegree,     couch[4] / kDegree,     couch[5] / kDegree};
}

NumberErrors ErrorsOfNumbers(const Correction& correction, const TrueNumbers& truth) {
  const auto value = InOrder(correction.value);
  const auto u95 = InOrder(correction.u95);
  NumberErrors errors;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    if (value[i] && u95[i]) errors[i] = NumberError{*value[i], truth[i], *u95[i]};
  }
  return errors;
}

void IntervalCoverage::Add(const NumberErrors& errors) {
  for (std::size_t i = 0; i < errors.size(); ++i) {
    if (!errors[i]) continue;
    for (IntervalCount* counted : {&numbers[i], &all}) {
      ++counted->count;
      counted->inside += errors[i]->IsInside() ? 1 : 0;
    }
  }
}

void VerdictCount::Add(Verdict verdict, const TrueNumbers& truth, const AcceptanceLimits& limits) {
  const bool is_in = LiesWithin(truth, limits, 0, 0);
  const bool is_well_in = LiesWithin(truth, limits, kWellInShift_mm, kWellInRotation_deg);
  ++(is_in ? truly_in : truly_out);
  well_in += is_well_in ? 1 : 0;
  switch (verdict) {
    case Verdict::kInTolerance:
      ++in_tolerance;
      ++(is_in ? found_in : false_in_tolerance);
      found_well_in += is_well_in ? 1 : 0;
      break;
    case Verdict::kUnsure:
      ++unsure;
      break;
    case Verdict::kMove:
      ++move;
      false_move += is_in ? 1 : 0;
      break;
    case Verdict::kNoAnswer:
      ++no_answer;
      break;
  }
}

}  // namespace plumb
