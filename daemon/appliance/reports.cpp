#include "daemon/appliance/reports.hpp"

#include <array>
#include <cmath>
#include <ctime>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "daemon/config/version.hpp"
#include "daemon/files/pdf_report.hpp"
#include "drivers/files/file_io.hpp"

namespace plumb {
namespace {

using Json = nlohmann::json;

constexpr double kWarmUp_s = 15 * 60;
constexpr double kManyLost = 0.05;
constexpr int kMaxScans = 1000;
constexpr std::size_t kMaxJsonBytes = std::size_t{16} << 20;
constexpr std::array<const char*, 6> kAxes = {"vertical", "longitudinal", "lateral",
                                              "pitch",    "roll",         "yaw"};

/// Local time with its zone.
std::string TimeOf(web::WallClock::time_point time) {
  const std::time_t seconds = web::WallClock::to_time_t(time);
  std::tm local{};
  ::localtime_r(&seconds, &local);
  std::array<char, 64> text{};
  const std::size_t size = std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M %Z", &local);
  return {text.data(), size};
}

std::string Footer() {
  return fmt::format("Plumb {}, printed {}", Version(), TimeOf(web::WallClock::now()));
}

/// Nothing where the file is missing or no JSON: the report then leaves out what it says.
Json JsonIn(const std::filesystem::path& file) {
  try {
    return Json::parse(ReadTextFile(file, kMaxJsonBytes), nullptr, /*allow_exceptions=*/false);
  } catch (const std::exception&) {
    return Json::value_t::discarded;
  }
}

std::string VerdictOf(const web::Scan& scan) {
  if (!scan.result) return scan.purpose == web::ScanPurpose::kReference ? "REFERENCE" : "NO RESULT";
  const std::string& verdict = scan.result->verdict;
  return verdict == "in_tolerance" ? "IN TOLERANCE"
         : verdict == "unsure"     ? "NOT SURELY WITHIN"
         : verdict == "move"       ? "MOVE"
                                   : "NO ANSWER";
}

std::string WhyOf(const web::Scan& scan) {
  if (!scan.result) return scan.failure;
  const std::string& verdict = scan.result->verdict;
  if (verdict == "in_tolerance") return "Every value, with its uncertainty, is within tolerance.";
  if (verdict == "unsure") return "Every value is within tolerance, but not with its uncertainty.";
  if (verdict == "move") return "The correction below was to be applied.";
  return scan.result->reasons.empty() ? "" : scan.result->reasons.front();
}

std::array<std::optional<double>, 6> ValuesOf(const std::optional<web::SixNumbers>& numbers) {
  if (!numbers) return {};
  return {numbers->vertical_mm, numbers->longitudinal_mm, numbers->lateral_mm,
          numbers->pitch_deg,   numbers->roll_deg,        numbers->yaw_deg};
}

/// A correction that is no answer is no advice: it is left out.
std::vector<ReportNumber> NumbersOf(const web::Scan& scan, const web::Tolerance& tolerance) {
  std::vector<ReportNumber> numbers;
  if (!scan.result || !scan.result->correction || scan.result->verdict == "no_answer")
    return numbers;
  const auto values = ValuesOf(scan.result->correction), u95 = ValuesOf(scan.result->u95);
  const bool moves = scan.result->verdict == "move";
  for (std::size_t i = 0; i < kAxes.size(); ++i) {
    const bool is_shift = i < 3;
    const double half = u95[i].value_or(0.0);
    const bool known = values[i] && std::abs(*values[i]) > half;
    numbers.push_back({.name = kAxes[i],
                       .unit = is_shift ? "mm" : "\xC2\xB0",
                       .value = values[i],
                       .u95 = half,
                       .tolerance = is_shift ? tolerance.shift_mm : tolerance.rotation_deg,
                       .words = !moves  ? "no move needed"
                                : known ? scan.result->words[i]
                                        : "below its uncertainty"});
  }
  return numbers;
}

ReportFacts QualityOf(const web::Scan& scan, const Json& scene, const Json& result) {
  ReportFacts facts;
  if (result.is_object() && result.contains("alignment") && result["alignment"].is_object()) {
    facts.emplace_back(
        "Markers matched",
        fmt::format("{}", result["alignment"].value("markers_used", Json::array()).size()));
    facts.emplace_back("Marker misfit",
                       fmt::format("{:.2f} mm", 1000 * result["alignment"].value("rms_m", 0.0)));
  }
  if (result.is_object() && result.contains("region") && result["region"].is_object()) {
    facts.emplace_back("Region covered",
                       fmt::format("{:.1f} %", 100 * result["region"].value("coverage", 0.0)));
    facts.emplace_back("Largest hole", fmt::format("{:.0f} mm", 1000 * result["region"].value(
                                                                           "largest_hole_m", 0.0)));
  }
  if (scene.is_object() && scene.contains("frames")) {
    const Json& frames = scene["frames"];
    facts.emplace_back("Frames tracked", fmt::format("{} of {}", frames.value("tracked", 0),
                                                     frames.value("total", 0)));
    facts.emplace_back("Frames lost", fmt::format("{}", frames.value("dropped", 0)));
    facts.emplace_back("Keyframes", fmt::format("{}", scene.value("keyframes", 0)));
  }
  if (scan.sensor_on_s)
    facts.emplace_back("Sensor on for", fmt::format("{:.0f} min", *scan.sensor_on_s / 60));
  return facts;
}

std::vector<std::string> CautionsOf(const web::Scan& scan, const Json& scene) {
  std::vector<std::string> cautions;
  if (scene.is_object() && scene.contains("frames")) {
    const double total = scene["frames"].value("total", 0.0);
    const double lost = scene["frames"].value("dropped", 0.0);
    if (total > 0 && lost / total >= kManyLost)
      cautions.push_back(fmt::format("{:.0f} % of the frames were lost.", 100 * lost / total));
  }
  if (scan.sensor_on_s && *scan.sensor_on_s < kWarmUp_s)
    cautions.emplace_back("The sensor was still warming up.");
  if (scan.check_overdue) cautions.emplace_back("The daily check was overdue at this scan.");
  return cautions;
}

std::string PlanText(const web::ReferencePlan& plan) {
  return fmt::format("{}, {} markers, tolerance {:g} mm and {:g}\xC2\xB0", plan.posture,
                     plan.couch_markers ? "couch" : "room", plan.tolerance.shift_mm,
                     plan.tolerance.rotation_deg);
}

ReportFacts IdentityOf(const web::Scan& scan, const std::optional<web::Patient>& patient,
                       const std::optional<web::Reference>& reference) {
  ReportFacts facts = {{"Patient", patient ? patient->code : "none (unassigned)"},
                       {"Site", patient && !patient->site.empty() ? patient->site : "-"},
                       {"Fraction", scan.fraction > 0 ? fmt::format("{}", scan.fraction) : "-"},
                       {"Scan", fmt::format("{}, {}", scan.id, TimeOf(scan.started_at))}};
  if (reference) {
    facts.emplace_back("Reference", fmt::format("version {}, {}", reference->version,
                                                TimeOf(reference->created_at)));
    facts.emplace_back("Plan", PlanText(reference->plan));
    facts.emplace_back("Planned by", reference->planned_by);
    facts.emplace_back("Approved by", reference->approved_at
                                          ? fmt::format("{}, {}", reference->approved_by,
                                                        TimeOf(*reference->approved_at))
                                          : std::string("not approved"));
    facts.emplace_back("Checksum", reference->digest.substr(0, 16));
  }
  facts.emplace_back("Accepted", scan.accepted_by.empty() ? std::string("no")
                                 : scan.accepted_reason.empty()
                                     ? "by " + scan.accepted_by
                                     : fmt::format("outside tolerance by {}: {}", scan.accepted_by,
                                                   scan.accepted_reason));
  return facts;
}

}  // namespace

std::string ScanReportPdf(Store& store, const web::Scan& scan) {
  const std::optional<web::Patient> patient = store.FindPatient(scan.patient_id);
  const std::optional<web::Reference> reference = store.FindReference(scan.reference_id);
  const Json scene = JsonIn(scan.folder / "scene/scene.json");
  const Json result = JsonIn(scan.folder / "result/result.json");
  const web::Tolerance tolerance = reference ? reference->plan.tolerance : web::Tolerance{};
  plumb::ScanReport report{
      .title = "Scan report",
      .verdict = VerdictOf(scan),
      .why = WhyOf(scan),
      .identity = IdentityOf(scan, patient, reference),
      .numbers = NumbersOf(scan, tolerance),
      .cautions = CautionsOf(scan, scene),
      .quality = QualityOf(scan, scene, result),
      .body = {},
      .pictures = {scan.folder / "result/error_map.png", scan.folder / "result/overlay.png"},
      .footer = Footer()};
  if (!report.numbers.empty()) report.body = scan.result->body_after;
  return PdfOf(report);
}

std::string CourseReportPdf(Store& store, const web::Patient& patient) {
  plumb::CourseReport report{.title = fmt::format("Course of {}", patient.code),
                             .identity = {{"Site", patient.site.empty() ? "-" : patient.site},
                                          {"Scans", fmt::format("{}", patient.num_scans)}},
                             .rows = {},
                             .footer = Footer()};
  std::vector<web::Scan> scans = store.Scans(patient.id, kMaxScans);
  bool is_any_overdue = false;
  for (auto scan = scans.rbegin(); scan != scans.rend(); ++scan) {
    if (scan->outcome != web::ScanOutcome::kDone) continue;
    CourseRow row{.fraction = scan->fraction > 0 ? fmt::format("{}", scan->fraction) : "-",
                  .when = TimeOf(scan->started_at).substr(0, 16),
                  .verdict = VerdictOf(*scan),
                  .accepted = scan->accepted_by,
                  .values = {}};
    if (scan->check_overdue) {
      row.verdict += " *";
      is_any_overdue = true;
    }
    if (!scan->accepted_reason.empty()) row.accepted += ": " + scan->accepted_reason;
    if (scan->result && scan->result->verdict != "no_answer")
      row.values = ValuesOf(scan->result->correction);
    report.rows.push_back(std::move(row));
  }
  if (is_any_overdue) report.identity.emplace_back("* Daily check", "overdue at this scan");
  return PdfOf(report);
}

}  // namespace plumb
