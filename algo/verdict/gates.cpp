// SPDX-License-Identifier: Apache-2.0
#include "algo/verdict/gates.hpp"

#include <cmath>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "words/acceptance.hpp"
#include "words/number.hpp"

namespace plumb {
namespace {

using Reasons = std::vector<Message>;

// Each gate passes only on a comparison that is true, so that NaN is refused.

void JudgeRegion(const Evidence& evidence, const AcceptanceLimits& limits, Reasons& reasons) {
  // Without a support the region would be everything that was measured, and a stationary couch
  // would hide that the body moved.
  if (!evidence.reference_has_support && !evidence.region_is_drawn)
    reasons.push_back(say::acceptance::NoSupport());
  if (std::isnan(evidence.coverage)) {
    reasons.push_back(say::acceptance::CoverageUnknown());
  } else if (!(evidence.coverage >= limits.min_coverage)) {
    reasons.push_back(
        say::acceptance::CoverageLow(100 * evidence.coverage, 100 * limits.min_coverage));
  }
  if (std::isnan(evidence.largest_hole_m)) {
    reasons.push_back(say::acceptance::HolesUnknown());
  } else if (!(evidence.largest_hole_m <= limits.max_hole_m)) {
    const double hole_mm = evidence.largest_hole_m / kMillimetre,
                 most_mm = limits.max_hole_m / kMillimetre;
    reasons.push_back(evidence.hole_place.empty()
                          ? say::acceptance::Hole(hole_mm, most_mm)
                          : say::acceptance::HoleAt(hole_mm, evidence.hole_place, most_mm));
  }
  if (std::isnan(evidence.residual_p95_m)) {
    reasons.push_back(say::acceptance::FitUnknown());
  } else if (!(evidence.residual_p95_m <= limits.max_residual_p95_m)) {
    const double residual_mm = evidence.residual_p95_m / kMillimetre;
    reasons.push_back(MarkersDisagree(evidence.markers_rms_m)
                          ? say::acceptance::NotAlikeOrDistorted(
                                residual_mm, evidence.markers_rms_m / kMillimetre)
                          : say::acceptance::NotAlike(residual_mm));
  }
}

void JudgeTracking(const Evidence& evidence, const AcceptanceLimits& limits, Reasons& reasons) {
  const auto judge = [&](double lost_s, const Message& scan) {
    if (lost_s <= limits.max_lost_s) return;
    reasons.push_back(std::isnan(lost_s) ? say::acceptance::LostUnknown(scan)
                                         : say::acceptance::Lost(lost_s, scan));
  };
  judge(evidence.reference_lost_s, say::acceptance::ScanReference());
  judge(evidence.current_lost_s, say::acceptance::ScanCurrent());
}

void JudgeBreathing(const Evidence& evidence, const AcceptanceLimits& limits, Reasons& reasons) {
  const auto judge = [&](double rise_m, const Message& scan) {
    if (rise_m <= limits.max_breathing_m) return;
    reasons.push_back(say::acceptance::Breathing(rise_m / kMillimetre, scan,
                                                 limits.max_breathing_m / kMillimetre));
  };
  judge(evidence.reference_breathing_m, say::acceptance::ScanReference());
  judge(evidence.current_breathing_m, say::acceptance::ScanCurrent());
}

Message NotWellDetermined(std::size_t number, double u95, double tolerance) {
  // From 100 on, decimals would mean nothing.
  const bool is_known = u95 < 100.0;
  const Message name = NumberWord(number);
  if (IsShift(number))
    return is_known ? say::acceptance::ShiftUncertain(name, u95, tolerance)
                    : say::acceptance::ShiftUnknown(name, u95, tolerance);
  return is_known ? say::acceptance::TurnUncertain(name, u95, tolerance)
                  : say::acceptance::TurnUnknown(name, u95, tolerance);
}

// The sweep that is to be repeated. Of nine sweeps each of four classes, one or two of a class are
// the cause of almost every refusal for uncertainty: they know their markers 1.6 to 4 times worse
// than the others, which differ among each other by less than 1.4.
void NamePoorerScan(const Evidence& evidence, Reasons& reasons) {
  constexpr double kPoorer = 1.5;
  const double reference_m = evidence.reference_markers_sigma_m;
  const double current_m = evidence.current_markers_sigma_m;
  const auto name = [&](const Message& scan, double own_m, double other_m) {
    if (own_m >= kPoorer * other_m)
      reasons.push_back(
          say::acceptance::PoorerScan(scan, own_m / kMillimetre, other_m / kMillimetre));
  };
  name(say::acceptance::ScanReference(), reference_m, current_m);
  name(say::acceptance::ScanCurrent(), current_m, reference_m);
}

void JudgeUncertainty(const Evidence& evidence, const AcceptanceLimits& limits, Reasons& reasons) {
  const Message* doubt = nullptr;
  for (std::size_t i = 0; i < evidence.numbers.size(); ++i) {
    const std::optional<MeasuredNumber>& number = evidence.numbers[i];
    if (!number) {
      if (!IsShift(i)) reasons.push_back(say::acceptance::NotMeasured(NumberWord(i)));
      continue;
    }
    if (!std::isfinite(number->value)) {
      reasons.push_back(say::acceptance::NotMeasured(NumberWord(i)));
    } else if (!(number->u95 > 0 && number->u95 <= ToleranceOf(limits, i))) {
      reasons.push_back(NotWellDetermined(i, number->u95, ToleranceOf(limits, i)));
      if (doubt == nullptr) doubt = IsShift(i) ? &evidence.shift_doubt : &evidence.turn_doubt;
    }
  }
  if (doubt == nullptr) return;
  if (!doubt->empty()) reasons.push_back(*doubt);
  NamePoorerScan(evidence, reasons);
}

/// What is said of values that no gate refuses.
Reasons ReasonsOf(const Evidence& evidence, const AcceptanceLimits& limits,
                  const Decision& decision) {
  Reasons outside;
  Reasons unsure;
  for (std::size_t i = 0; i < evidence.numbers.size(); ++i) {
    if (!evidence.numbers[i]) continue;
    const MeasuredNumber& number = *evidence.numbers[i];
    const Message name = NumberWord(i);
    if (decision.numbers[i] == NumberJudgement::kOutside) {
      outside.push_back(IsShift(i)
                            ? say::acceptance::OutsideShift(name, number.value, number.words)
                            : say::acceptance::OutsideTurn(name, number.value, number.words));
    } else if (decision.numbers[i] != NumberJudgement::kWithin) {
      unsure.push_back(IsShift(i) ? say::acceptance::UnsureShift(name, number.value, number.u95)
                                  : say::acceptance::UnsureTurn(name, number.value, number.u95));
    }
  }
  const double shift_mm = ToleranceOf(limits, 0), turn_deg = ToleranceOf(limits, 3);
  if (decision.verdict == Verdict::kMove)
    return {say::acceptance::Outside(shift_mm, turn_deg, std::move(outside))};
  if (decision.verdict == Verdict::kUnsure)
    return {say::acceptance::Unsure(shift_mm, turn_deg, std::move(unsure))};
  return {say::acceptance::Within(shift_mm, turn_deg)};
}

}  // namespace

bool MarkersDisagree(double rms_m) {
  constexpr double kMostRms_m = 2.5 * kMillimetre;
  return rms_m > kMostRms_m;
}

Message NumberWord(std::size_t number) {
  namespace word = say::number;
  constexpr std::array<Message (*)(), 6> kWords = {
      word::Vertical, word::Longitudinal, word::Lateral, word::Pitch, word::Roll, word::Yaw};
  return kWords.at(number)();
}

std::vector<Message> RefusalsOfMarkers(const MarkerEvidence& markers, int min_shared_markers) {
  std::vector<Message> reasons;
  const auto shared = static_cast<std::int64_t>(markers.shared_ids.size());
  if (shared < min_shared_markers) {
    reasons.push_back(shared == 0 ? say::acceptance::SharedNone(min_shared_markers)
                                  : say::acceptance::SharedFew(
                                        min_shared_markers, shared,
                                        {markers.shared_ids.begin(), markers.shared_ids.end()}));
  } else if (markers.good < min_shared_markers) {
    reasons.push_back(say::acceptance::FewAgree(min_shared_markers, markers.good, shared));
  } else if (markers.two_groups) {
    reasons.push_back(say::acceptance::TwoGroups(markers.good));
  }
  if (!markers.moved_used.empty()) {
    reasons.push_back(
        say::acceptance::MovedUsed(static_cast<std::int64_t>(markers.moved_used.size()),
                                   {markers.moved_used.begin(), markers.moved_used.end()}));
  }
  return reasons;
}

double ToleranceOf(const AcceptanceLimits& limits, std::size_t number) {
  return IsShift(number) ? limits.shift_tolerance_m / kMillimetre
                         : limits.rotation_tolerance_rad / kDegree;
}

void CheckLimits(const AcceptanceLimits& limits) {
  const auto refuse = [](const char* name, const std::string& expected, double value) {
    throw std::invalid_argument(
        fmt::format("acceptance: {} must be {}, got {:g}", name, expected, value));
  };
  // A limit of 0 would let nothing pass.
  const auto check = [&](double value, double most, const char* name) {
    if (!(value > 0 && value <= most))
      refuse(name, fmt::format("above 0 and at most {:g}", most), value);
  };
  constexpr const AcceptanceLimits& kLoosest = kLoosestLimits;
  check(limits.shift_tolerance_m, kLoosest.shift_tolerance_m, "the shift tolerance");
  check(limits.rotation_tolerance_rad, kLoosest.rotation_tolerance_rad, "the rotation tolerance");
  if (limits.min_shared_markers < kLoosest.min_shared_markers)
    refuse("the number of shared markers", fmt::format("at least {}", kLoosest.min_shared_markers),
           limits.min_shared_markers);
  if (!(limits.min_coverage >= kLoosest.min_coverage && limits.min_coverage <= 1.0))
    refuse("the coverage", fmt::format("from {:g} to 1", kLoosest.min_coverage),
           limits.min_coverage);
  check(limits.max_hole_m, kLoosest.max_hole_m, "the largest hole");
  check(limits.max_residual_p95_m, kLoosest.max_residual_p95_m, "the residual limit");
  check(limits.max_lost_s, kLoosest.max_lost_s, "the limit of lost tracking");
  check(limits.max_breathing_m, kLoosest.max_breathing_m, "the limit of breathing");
}

Verdict VerdictOf(const NumberJudgements& judgements, const std::array<bool, 6>& is_reported) {
  Verdict verdict = Verdict::kInTolerance;
  for (std::size_t i = 0; i < judgements.size(); ++i) {
    if (!is_reported[i]) continue;
    if (judgements[i] == NumberJudgement::kOutside) return Verdict::kMove;
    if (judgements[i] != NumberJudgement::kWithin) verdict = Verdict::kUnsure;
  }
  return verdict;
}

Decision Decide(const Evidence& evidence, const AcceptanceLimits& limits) {
  Decision decision;
  std::array<bool, 6> is_reported{};
  for (std::size_t i = 0; i < evidence.numbers.size(); ++i) {
    const std::optional<MeasuredNumber>& number = evidence.numbers[i];
    is_reported[i] = number.has_value();
    if (number)
      decision.numbers[i] = JudgeNumber(number->value, number->u95, ToleranceOf(limits, i));
  }
  decision.reasons = evidence.refusals;
  if (!evidence.failure.empty()) {
    decision.reasons.push_back(evidence.failure);
    return decision;
  }
  for (Message& refusal : RefusalsOfMarkers(evidence.markers, limits.min_shared_markers))
    decision.reasons.push_back(std::move(refusal));
  JudgeRegion(evidence, limits, decision.reasons);
  JudgeTracking(evidence, limits, decision.reasons);
  JudgeBreathing(evidence, limits, decision.reasons);
  JudgeUncertainty(evidence, limits, decision.reasons);
  if (!decision.reasons.empty()) return decision;
  decision.verdict = VerdictOf(decision.numbers, is_reported);
  decision.reasons = ReasonsOf(evidence, limits, decision);
  return decision;
}

}  // namespace plumb
