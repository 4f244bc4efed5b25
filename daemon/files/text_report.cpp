#include "daemon/files/text_report.hpp"

#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "algo/base/notice.hpp"
#include "algo/base/units.hpp"

namespace plumb {
namespace {

const char* Title(Verdict verdict) {
  switch (verdict) {
    case Verdict::kInTolerance:
      return "IN TOLERANCE";
    case Verdict::kUnsure:
      return "NOT SURELY WITHIN TOLERANCE";
    case Verdict::kMove:
      return "MOVE";
    case Verdict::kNoAnswer:
      break;
  }
  return "NO ANSWER";
}

std::string NumberRow(const char* name, const std::optional<double>& value,
                      const std::optional<double>& u95, double tolerance, const char* unit,
                      const std::string& words) {
  if (!value)
    return fmt::format("  {:<14}   refused: couch-fixed markers show posture only\n", name);
  const bool is_outside = !(std::abs(*value) <= tolerance);
  const bool is_in = u95 && std::abs(*value) + *u95 <= tolerance;
  const int digits = std::string_view(unit) == "mm" ? 1 : 2;
  // printed as zero, without sign and direction
  const bool is_zero = std::abs(*value) < (digits == 1 ? 0.05 : 0.005);
  return fmt::format("  {:<14} {:>+9.{}f} {:<4}  ±{:>5.{}f}   {:>5.3g} {:<4} {}  {}\n", name,
                     is_zero ? 0.0 : *value, digits, unit, u95.value_or(NAN), digits, tolerance,
                     unit,
                     is_outside ? "MOVE  "
                     : is_in    ? "ok    "
                                : "unsure",
                     is_zero ? "" : words);
}

std::string CorrectionTable(const Correction& correction, const CompareOptions& options) {
  const double shift_mm = options.limits.shift_tolerance_m / kMillimetre,
               rotation_deg = options.limits.rotation_tolerance_rad / kDegree;
  const CouchNumbers &v = correction.value, &u = correction.u95;
  std::string text = fmt::format(
      "\nCorrection to apply, at the isocentre ({:.3f}, {:.3f}, {:.3f}) m of the reference "
      "marker's frame\n\n",
      correction.isocentre_m.x(), correction.isocentre_m.y(), correction.isocentre_m.z());
  text += "                     value        95 %   tolerance\n";
  text += NumberRow("vertical", v.vertical_mm, u.vertical_mm, shift_mm, "mm", correction.words[0]);
  text += NumberRow("longitudinal", v.longitudinal_mm, u.longitudinal_mm, shift_mm, "mm",
                    correction.words[1]);
  text += NumberRow("lateral", v.lateral_mm, u.lateral_mm, shift_mm, "mm", correction.words[2]);
  text += NumberRow("pitch", v.pitch_deg, u.pitch_deg, rotation_deg, "deg", correction.words[3]);
  text += NumberRow("roll", v.roll_deg, u.roll_deg, rotation_deg, "deg", correction.words[4]);
  text += NumberRow("yaw", v.yaw_deg, u.yaw_deg, rotation_deg, "deg", correction.words[5]);
  return text;
}

std::string TrustLines(const Comparison& comparison) {
  std::string text = "\nScan quality\n\n";
  if (const auto& alignment = comparison.alignment) {
    text += fmt::format("  markers          {} matched ({}), RMS {:.2f} mm\n",
                        alignment->markers_used.size(), fmt::join(alignment->markers_used, ", "),
                        alignment->rms_m / kMillimetre);
    for (const auto& [id, residual_m] : alignment->markers_rejected) {
      text += fmt::format("                   marker {} moved {:.1f} mm; ignored\n", id,
                          residual_m / kMillimetre);
    }
  } else {
    text += "  markers          no alignment\n";
  }
  if (const auto& region = comparison.region) {
    text += fmt::format("  region           {:.1f} % covered, largest hole {:.0f} mm\n",
                        100 * region->coverage, region->largest_hole_m / kMillimetre);
  }
  if (const auto& motion = comparison.motion) {
    text +=
        fmt::format("  surface residual {:.2f} mm median, {:.2f} mm 95th percentile\n",
                    motion->residual_median_m / kMillimetre, motion->residual_p95_m / kMillimetre);
    for (const WeakDirection& weak : motion->weak_directions) {
      text += fmt::format("  weak direction   {}: ±{:.3g} {}\n", weak.name, weak.u95, weak.unit);
    }
  }
  for (const std::string& warning : comparison.warnings)
    text += fmt::format("  warning          {}\n", warning);
  return text;
}

}  // namespace

std::string ComparisonText(const Comparison& comparison, const CompareOptions& options) {
  std::string text = std::string(Title(comparison.verdict)) + "\n";
  for (const std::string& reason : comparison.reasons) text += fmt::format("  {}\n", reason);
  if (comparison.correction) {
    text += CorrectionTable(*comparison.correction, options);
    if (!options.T_iec_reference)
      text +=
          "\n  The room is not known ([iec] T_iec_reference is not set): the numbers are along "
          "and\n"
          "  about the reference marker's axes, not the couch's.\n";
  }
  return text + TrustLines(comparison) + "\n" + std::string(kResearchNotice) + "\n";
}

std::string PictureSubtitle(const Comparison& comparison) {
  std::string text = Title(comparison.verdict);
  if (comparison.correction) {
    const CouchNumbers& v = comparison.correction->value;
    const auto shift = [](const std::optional<double>& mm) {
      return mm ? fmt::format("{:+.1f}", *mm) : std::string("refused");
    };
    text += fmt::format(
        "; apply vertical {}, longitudinal {}, lateral {} mm; pitch {:+.2f}, roll {:+.2f}, yaw "
        "{:+.2f} deg",
        shift(v.vertical_mm), shift(v.longitudinal_mm), shift(v.lateral_mm), v.pitch_deg,
        v.roll_deg, v.yaw_deg);
  } else if (!comparison.reasons.empty()) {
    text += ": " + comparison.reasons.front();
  }
  return text;
}

}  // namespace plumb
