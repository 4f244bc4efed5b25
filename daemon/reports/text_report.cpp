// SPDX-License-Identifier: Apache-2.0
#include "daemon/reports/text_report.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include <fmt/format.h>

#include "algo/base/units.hpp"
#include "algo/base/utf8.hpp"
#include "algo/verdict/shown_row.hpp"
#include "daemon/result/shown_rows.hpp"
#include "words/number.hpp"
#include "words/result.hpp"
#include "words/text_report.hpp"

namespace plumb {
namespace {

Message Title(Verdict verdict) {
  switch (verdict) {
    case Verdict::kInTolerance:
      return say::text_report::InTolerance();
    case Verdict::kUnsure:
      return say::text_report::Unsure();
    case Verdict::kMove:
      return say::text_report::Move();
    case Verdict::kNoAnswer:
      break;
  }
  return say::text_report::NoAnswer();
}

/// Only the verdict MOVE asks for moves.
Message Heading(const StoredResult& result) {
  const auto say =
      result.verdict == Verdict::kMove ? say::text_report::Correction : say::text_report::Measured;
  // A plan's isocentre is the origin of the axes of its scene, not of the reference marker.
  if (result.compared_with) return say(say::result::AtIsocentre());
  const auto point =
      IsAboutMiddle(result) ? say::text_report::AboutMiddle : say::text_report::AtIsocentre;
  const Eigen::Vector3d& p_m = result.correction->isocentre;
  return say(point(p_m.x(), p_m.y(), p_m.z()));
}

Message NumberName(std::string_view name) {
  return Message::Stored("number." + std::string(name), {}, name);
}

/// Writes the report line by line.
class Report {
 public:
  explicit Report(const Catalogue& language) : language_(language) {}

  [[nodiscard]] std::string Said(const Message& message) const { return Text(message, language_); }
  void Line(const std::string& line) { text_ += line + "\n"; }
  /// A label in its column, and what it labels.
  void Row(const Message& label, const Message& value) {
    Line("  " + Left(Said(label), 16) + " " + Said(value));
  }

  void Numbers(const std::vector<ShownRow>& rows, Verdict verdict);
  void Trust(const StoredResult& result);
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  static std::string Spaces(std::string_view text, std::size_t characters) {
    const std::size_t has = Utf8Characters(text);
    return std::string(has < characters ? characters - has : 0, ' ');
  }
  static std::string Left(const std::string& text, std::size_t characters) {
    return text + Spaces(text, characters);
  }
  static std::string Right(const std::string& text, std::size_t characters) {
    return Spaces(text, characters) + text;
  }
  /// A number with the decimal sign of the language.
  [[nodiscard]] std::string Number(std::string number) const {
    std::replace(number.begin(), number.end(), '.', language_.decimal);
    return number;
  }
  [[nodiscard]] std::size_t Width(const std::vector<ShownRow>& rows,
                                  const std::function<Message(const ShownRow&)>& text) const {
    std::size_t width = 0;
    for (const ShownRow& row : rows) width = std::max(width, Utf8Characters(Said(text(row))));
    return width;
  }

  const Catalogue& language_;
  std::string text_;
};

void Report::Numbers(const std::vector<ShownRow>& rows, Verdict verdict) {
  const auto name_of = [](const ShownRow& row) { return row.name; };
  const auto mark_of = [](const ShownRow& row) { return JudgementWord(row.judgement); };
  const std::size_t names = std::max<std::size_t>(14, Width(rows, name_of));
  const std::size_t marks = Width(rows, mark_of);
  Line(Right(Said(say::text_report::Value()), names + 12) +
       Right(Said(say::text_report::Confidence()), 12) +
       Right(Said(say::text_report::Tolerance()), 12));
  for (const ShownRow& row : rows) {
    const std::string label = "  " + Left(Said(row.name), names) + " ";
    if (!row.value) {
      Line(label + "  " + Said(say::text_report::Refused()));
      continue;
    }
    const char* const unit = UnitOf(row.number);
    const int digits = IsShift(row.number) ? 1 : 2;
    // printed as zero, without sign
    const bool is_zero = std::abs(*row.value) < (digits == 1 ? 0.05 : 0.005);
    const std::string half =
        row.u95 && *row.u95 > 0 ? fmt::format("{:.{}f}", *row.u95, digits) : "?";
    const std::string numbers =
        Number(fmt::format("{:>+9.{}f} {:<4}  ±{:>5}   {:>5.3g} {:<4}", is_zero ? 0.0 : *row.value,
                           digits, unit, half, row.tolerance, unit));
    Line(label + numbers + " " + Left(Said(mark_of(row)), marks) + "  " +
         Said(WayOf(row, verdict)));
  }
}

void Report::Trust(const StoredResult& result) {
  Line("\n" + Said(say::text_report::Quality()) + "\n");
  if (const auto& planned = result.compared_with) {
    Row(say::text_report::Reference(), ComparedWith(*planned));
    if (const Message stated = SurfaceStated(*planned); !stated.empty())
      Row(say::text_report::Surface(), stated);
  }
  if (const auto& alignment = result.alignment) {
    Row(say::text_report::Markers(), MarkersThatPlace(*alignment));
    for (const auto& [id, residual_m] : alignment->markers_rejected)
      Row({}, say::text_report::MarkerMoved(id, residual_m / kMillimetre));
  } else {
    Row(say::text_report::Markers(), say::text_report::NoAlignment());
  }
  if (const auto& region = result.region)
    Row(say::text_report::Region(),
        say::text_report::Covered(100 * region->coverage, region->largest_hole_m / kMillimetre));
  if (const auto& motion = result.motion) {
    Row(say::text_report::Residual(),
        say::text_report::Residuals(motion->residual_m.median / kMillimetre,
                                    motion->residual_m.p95 / kMillimetre));
    for (const StoredWeakDirection& weak : motion->weak_directions)
      Row(say::text_report::Weak(),
          say::text_report::WeakOf(NumberName(weak.name),
                                   Number(fmt::format("{:.3g}", weak.u95)) + " " + weak.unit));
  }
  for (const Message& warning : result.warnings) Row(say::text_report::Warning(), warning);
}

}  // namespace

Message ComparedWith(const StoredReference& planned) {
  if (!planned.skin_threshold_hu)
    return say::text_report::PlanningCt(planned.roi, planned.plan_label, planned.plan_date,
                                        planned.posture);
  return say::text_report::PlanningCtImages(*planned.skin_threshold_hu, planned.skin_u95_mm,
                                            planned.plan_label, planned.plan_date, planned.posture);
}

Message SurfaceStated(const StoredReference& planned) {
  if (planned.clothing_mm == 0 && planned.ct_breathing_mm == 0) return {};
  return say::text_report::SurfaceStated(planned.clothing_mm, planned.ct_breathing_mm);
}

Message MarkersThatPlace(const StoredAlignment& alignment) {
  const std::vector<int>& used = alignment.markers_used;
  const auto count = static_cast<std::int64_t>(used.size());
  if (std::isnan(alignment.rms_m))
    return say::text_report::PlacedByOne(count, {used.begin(), used.end()});
  return say::text_report::Matched(count, {used.begin(), used.end()},
                                   alignment.rms_m / kMillimetre);
}

std::string ComparisonText(const StoredResult& result, const Catalogue& language) {
  Report report(language);
  report.Line(report.Said(Title(result.verdict)));
  for (const Message& reason : result.reasons) report.Line("  " + report.Said(reason));
  if (const std::vector<ShownRow> rows = ShownRowsOf(result); !rows.empty()) {
    report.Line("\n" + report.Said(Heading(result)) + "\n");
    report.Numbers(rows, result.verdict);
    if (!result.body || !result.body->room_known)
      report.Line("\n  " + report.Said(say::text_report::RoomUnknown()));
  }
  report.Trust(result);
  report.Line("\n" + report.Said(say::result::Notice()));
  return report.text();
}

std::string PictureSubtitle(const Comparison& comparison) {
  std::string text = Title(comparison.verdict).English();
  if (comparison.correction && comparison.verdict != Verdict::kNoAnswer) {
    const CouchNumbers& v = comparison.correction->value;
    const auto shift = [](const std::optional<double>& mm) {
      return mm ? fmt::format("{:+.1f}", *mm) : std::string("refused");
    };
    text += fmt::format(
        "; {} vertical {}, longitudinal {}, lateral {} mm; pitch {:+.2f}, roll {:+.2f}, yaw "
        "{:+.2f} deg",
        comparison.verdict == Verdict::kMove ? "apply" : "measured", shift(v.vertical_mm),
        shift(v.longitudinal_mm), shift(v.lateral_mm), v.pitch_deg, v.roll_deg, v.yaw_deg);
  } else if (!comparison.reasons.empty()) {
    text += ": " + comparison.reasons.front().English();
  }
  return text;
}

}  // namespace plumb
