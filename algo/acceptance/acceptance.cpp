#include "algo/acceptance/acceptance.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace plumb {
namespace {

using Reasons = std::vector<std::string>;

// Each gate passes only on a comparison that is true, so that NaN is refused.

void JudgeRegion(const Evidence& evidence, const AcceptanceLimits& limits, Reasons& reasons) {
  // Without a support the region would be everything that was measured, and a stationary couch
  // would hide that the body moved.
  if (!evidence.reference_has_support && !evidence.region_is_drawn) {
    reasons.emplace_back(
        "no flat support was found in the reference scan, so the body cannot be separated from "
        "what it lies on; draw a region on the body, or scan the reference again with more of the "
        "couch in view");
  }
  if (std::isnan(evidence.coverage)) {
    reasons.emplace_back("how much of the region the current scan covers could not be measured");
  } else if (!(evidence.coverage >= limits.min_coverage)) {
    reasons.push_back(
        fmt::format("the current scan covers {:.1f} % of the region, at least {:g} % are needed; "
                    "sweep all of it",
                    100 * evidence.coverage, 100 * limits.min_coverage));
  }
  if (std::isnan(evidence.largest_hole_m)) {
    reasons.emplace_back("the holes of the current scan could not be measured");
  } else if (!(evidence.largest_hole_m <= limits.max_hole_m)) {
    const std::string place =
        evidence.hole_place.empty() ? "" : fmt::format(" ({})", evidence.hole_place);
    reasons.push_back(fmt::format(
        "the current scan has a hole of {:.0f} mm in the region{}; at most {:g} mm are allowed; "
        "sweep over it",
        evidence.largest_hole_m / kMillimetre, place, limits.max_hole_m / kMillimetre));
  }
  if (std::isnan(evidence.residual_p95_m)) {
    reasons.emplace_back("how well the surfaces fit could not be measured");
  } else if (!(evidence.residual_p95_m <= limits.max_residual_p95_m)) {
    reasons.push_back(
        fmt::format("the body does not look like this reference: 5 % of the region lie more than "
                    "{:.0f} mm away after the best motion",
                    evidence.residual_p95_m / kMillimetre));
  }
}

void JudgeTracking(const Evidence& evidence, const AcceptanceLimits& limits, Reasons& reasons) {
  const auto judge = [&](double lost_s, const char* scan) {
    if (lost_s <= limits.max_lost_s) return;
    if (std::isnan(lost_s)) {
      reasons.push_back(
          fmt::format("it is not known how long tracking was lost in the {} scan", scan));
      return;
    }
    reasons.push_back(
        fmt::format("tracking was lost for {:.1f} s in the {} scan, or no image came; sweep again, "
                    "more slowly",
                    lost_s, scan));
  };
  judge(evidence.reference_lost_s, "reference");
  judge(evidence.current_lost_s, "current");
}

void JudgeBreathing(const Evidence& evidence, const AcceptanceLimits& limits, Reasons& reasons) {
  const auto judge = [&](double rise_m, const char* scan) {
    if (rise_m <= limits.max_breathing_m) return;
    reasons.push_back(
        fmt::format("chest and belly rose by {:.1f} mm in the {} scan, at most {:g} mm are "
                    "allowed; sweep again while the breath is held",
                    rise_m / kMillimetre, scan, limits.max_breathing_m / kMillimetre));
  };
  judge(evidence.reference_breathing_m, "reference");
  judge(evidence.current_breathing_m, "current");
}

// Decimals of an uncertainty: those of the other texts, and none from 100 on, where they would mean
// nothing.
int Decimals(double u95, std::size_t i) {
  if (!(u95 < 100.0)) return 0;
  return IsShift(i) ? 1 : 2;
}

void JudgeUncertainty(const Evidence& evidence, const AcceptanceLimits& limits, Reasons& reasons) {
  for (std::size_t i = 0; i < evidence.numbers.size(); ++i) {
    const std::optional<MeasuredNumber>& number = evidence.numbers[i];
    if (!number) {
      if (!IsShift(i)) reasons.push_back(fmt::format("{} was not measured", kNumberNames[i]));
      continue;
    }
    if (!std::isfinite(number->value)) {
      reasons.push_back(fmt::format("{} was not measured", kNumberNames[i]));
    } else if (!(number->u95 >= 0 && number->u95 <= ToleranceOf(limits, i))) {
      reasons.push_back(fmt::format(
          "{} is not well determined: \u00b1{:.{}f} {} at 95 %, the tolerance is {:g} {}",
          kNumberNames[i], number->u95, Decimals(number->u95, i), UnitOf(i), ToleranceOf(limits, i),
          UnitOf(i)));
    }
  }
}

Decision JudgeValues(const Evidence& evidence, const AcceptanceLimits& limits) {
  Reasons outside;
  Reasons unsure;
  for (std::size_t i = 0; i < evidence.numbers.size(); ++i) {
    if (!evidence.numbers[i]) continue;
    const MeasuredNumber& number = *evidence.numbers[i];
    const double tolerance = ToleranceOf(limits, i);
    const double size = std::abs(number.value);
    if (size > tolerance) {
      outside.push_back(fmt::format("{} {:+.1f} {} ({})", kNumberNames[i], number.value, UnitOf(i),
                                    number.words));
    } else if (!(size + number.u95 <= tolerance)) {
      unsure.push_back(fmt::format("{} {:+.1f} \u00b1{:.1f} {}", kNumberNames[i], number.value,
                                   number.u95, UnitOf(i)));
    }
  }
  const std::string tolerances =
      fmt::format("{:g} mm and {:g} deg", ToleranceOf(limits, 0), ToleranceOf(limits, 3));
  if (!outside.empty()) {
    return {Verdict::kMove, {fmt::format("outside {}: {}", tolerances, fmt::join(outside, ", "))}};
  }
  if (!unsure.empty()) {
    return {Verdict::kUnsure,
            {fmt::format("not surely within {}: {}", tolerances, fmt::join(unsure, ", "))}};
  }
  return {Verdict::kInTolerance,
          {fmt::format("every value and its uncertainty lie within {}", tolerances)}};
}

}  // namespace

std::vector<std::string> RefusalsOfMarkers(const MarkerEvidence& markers, int min_shared_markers) {
  std::vector<std::string> reasons;
  const std::size_t shared = markers.shared_ids.size();
  if (static_cast<int>(shared) < min_shared_markers) {
    const std::string ids = shared == 0 ? ""
                                        : fmt::format(" (id{} {})", shared == 1 ? "" : "s",
                                                      fmt::join(markers.shared_ids, ", "));
    reasons.push_back(
        fmt::format("scan needs at least {} markers shared with the reference, found {}{}; keep "
                    "the markers in view",
                    min_shared_markers, shared, ids));
  } else if (markers.good < min_shared_markers) {
    reasons.push_back(
        fmt::format("scan needs at least {} markers that did not move since the reference, {} of "
                    "{} shared ones agree; check where the markers lie",
                    min_shared_markers, markers.good, shared));
  } else if (markers.two_groups) {
    reasons.push_back(
        fmt::format("the markers fall into two groups of {} that moved against each other; check "
                    "where the markers lie",
                    markers.good));
  }
  if (!markers.moved_used.empty()) {
    const bool one = markers.moved_used.size() == 1;
    reasons.push_back(
        fmt::format("marker{} {} moved since the reference, and this preset aligns the scans by {} "
                    "nevertheless; use preset best",
                    one ? "" : "s", fmt::join(markers.moved_used, ", "), one ? "it" : "them"));
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

Decision Decide(const Evidence& evidence, const AcceptanceLimits& limits) {
  if (!evidence.failure.empty()) return {Verdict::kNoAnswer, {evidence.failure}};
  Reasons reasons = RefusalsOfMarkers(evidence.markers, limits.min_shared_markers);
  JudgeRegion(evidence, limits, reasons);
  JudgeTracking(evidence, limits, reasons);
  JudgeBreathing(evidence, limits, reasons);
  JudgeUncertainty(evidence, limits, reasons);
  if (!reasons.empty()) return {Verdict::kNoAnswer, std::move(reasons)};
  return JudgeValues(evidence, limits);
}

}  // namespace plumb
