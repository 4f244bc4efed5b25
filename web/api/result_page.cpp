// The last result as plain HTML: for browsers without script, and for printing.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "web/api/api.hpp"
#include "web/api/json.hpp"
#include "web/assets/assets.hpp"
#include "web/http/checks.hpp"
#include "web/http/gate.hpp"

namespace plumb::web {
namespace {

constexpr std::string_view kNotice =
    "Research use only. Not a medical device. Do not use to position patients for treatment or to "
    "replace image guidance.";
constexpr std::chrono::minutes kOldAfter{2};
constexpr std::chrono::seconds kRefreshEvery{10};

struct NumberRow {
  const char* name;
  const char* unit;
  std::optional<double> value, u95;
};

std::array<NumberRow, 6> Rows(const SixNumbers& value, const SixNumbers& u95) {
  return {NumberRow{"vertical", "mm", value.vertical_mm, u95.vertical_mm},
          NumberRow{"longitudinal", "mm", value.longitudinal_mm, u95.longitudinal_mm},
          NumberRow{"lateral", "mm", value.lateral_mm, u95.lateral_mm},
          NumberRow{"pitch", "\xC2\xB0", value.pitch_deg, u95.pitch_deg},
          NumberRow{"roll", "\xC2\xB0", value.roll_deg, u95.roll_deg},
          NumberRow{"yaw", "\xC2\xB0", value.yaw_deg, u95.yaw_deg}};
}

/// @param refresh  Reloads the page, without counting as use, because its content may be outdated.
std::string Document(const std::string& body, const std::string& refresh = "") {
  std::string style;
  for (const Asset& asset : Assets()) {
    if (asset.type.starts_with("text/css"))
      style += fmt::format("<link rel=\"stylesheet\" href=\"{}\">", asset.path);
  }
  return fmt::format(
      "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width\">"
      "<title>Plumb result</title>{}{}</head><body class=\"plain\"><aside class=\"notice\" "
      "aria-label=\"Notice\"><p>{}</p></aside><main>{}</main></body></html>",
      refresh.empty() ? ""
                      : fmt::format("<meta http-equiv=\"refresh\" content=\"{};url={}\">",
                                    kRefreshEvery.count(), refresh),
      style, kNotice, body);
}

std::string LoginForm(std::string_view trouble) {
  return fmt::format(
      "<h1>Log in</h1>{}<form method=\"post\" action=\"/login\" class=\"card form\">"
      "<label>Name <input name=\"name\" autocomplete=\"username\" required "
      "maxlength=\"32\"></label>"
      "<label>Password <input name=\"password\" type=\"password\" "
      "autocomplete=\"current-password\" required maxlength=\"128\"></label>"
      "<button class=\"primary\">Log in</button></form>",
      trouble.empty() ? "" : fmt::format("<p role=\"alert\">{}</p>", trouble));
}

/// Decimals that the uncertainty justifies: none below its first digit.
int DigitsOf(double u95, int most) {
  if (!(u95 > 0)) return most;
  return std::clamp(static_cast<int>(-std::floor(std::log10(u95) + 1e-9)), 0, most);
}

/// A row of the table. Only the verdict MOVE asks for moves.
std::string NumberCells(const NumberRow& row, const std::string& words, double tolerance,
                        bool moves) {
  if (!row.value)
    return fmt::format(
        "<tr><th scope=\"row\">{}</th><td>not known</td><td></td><td></td><td></td>"
        "<td></td></tr>",
        row.name);
  const double value = *row.value, u95 = row.u95.value_or(0.0), size = std::abs(value);
  const int most = std::string_view(row.unit) == "mm" ? 1 : 2;
  const int digits = DigitsOf(u95, most);
  const bool is_zero = size < 0.5 * std::pow(10.0, -digits);  // no sign, no direction
  const bool in = size + u95 <= tolerance, unsure = !in && size <= tolerance;
  const std::string direction = !moves        ? "no move needed"
                                : is_zero     ? "no change"
                                : size <= u95 ? "below its uncertainty"
                                              : EscapeHtml(words);
  return fmt::format(
      "<tr><th scope=\"row\">{}</th><td>{}</td><td>\xC2\xB1 {:.{}f}</td><td>\xC2\xB1 {:g}</td>"
      "<td>{}</td><td>{}</td></tr>",
      row.name,
      is_zero ? fmt::format("{:.{}f} {}", 0.0, digits, row.unit)
              : fmt::format("{:+.{}f} {}", value, digits, row.unit),
      u95, most, tolerance,
      in       ? "in tolerance"
      : unsure ? "not surely within"
               : "outside tolerance",
      direction);
}

/// A correction without an answer must not be applied, so it is left out.
/// @param review  The page is for reading or printing, or the result can no longer be acted on.
std::string NumbersTable(const ResultSummary& result, const Tolerance& tolerance, bool review) {
  if (!result.correction || result.verdict == "no_answer") return "";
  const bool moves = result.verdict == "move";
  std::string rows;
  std::size_t i = 0;
  for (const NumberRow& row : Rows(*result.correction, result.u95.value_or(SixNumbers{}))) {
    rows += NumberCells(row, result.words[i], i < 3 ? tolerance.shift_mm : tolerance.rotation_deg,
                        moves);
    ++i;
  }
  return fmt::format(
      "<table><caption>{}</caption><thead><tr><th scope=\"col\">axis</th><th "
      "scope=\"col\">value</th><th scope=\"col\">95 %</th><th scope=\"col\">tolerance</th><th "
      "scope=\"col\">judgement</th><th scope=\"col\">direction</th></tr></thead><tbody>{}</tbody>"
      "</table>",
      moves && review ? "Correction found then, at the isocentre: not to be applied now"
      : moves         ? "Correction to apply at the isocentre"
      : review        ? "Difference that remained then, at the isocentre"
                      : "Remaining difference at the isocentre: no move needed",
      rows);
}

std::string BodyList(const ResultSummary& result) {
  if (!result.correction || result.verdict == "no_answer") return "";
  const auto list = [](const char* title, const std::vector<std::string>& words) {
    std::string items;
    for (const std::string& text : words) items += fmt::format("<li>{}</li>", EscapeHtml(text));
    return fmt::format(
        "<h3>{}</h3><ul class=\"findings\">{}</ul>", title,
        items.empty() ? "<li class=\"fine-part\">as in the reference, within 3 mm</li>" : items);
  };
  return "<h2>Where on the body</h2>" + list("Now", result.body_now) +
         list("Posture difference that remains after the shift", result.body_after);
}

std::string Pictures(const Scan& scan) {
  std::error_code ignored;
  if (!std::filesystem::exists(scan.folder / "result/error_map.png", ignored)) return "";
  return fmt::format(
      "<figure><img src=\"/api/v1/scans/{0}/files/error_map.png\" alt=\"Map of height errors, "
      "current minus reference\"></figure>"
      "<figure><img src=\"/api/v1/scans/{0}/files/overlay.png\" alt=\"Reference blue, current "
      "red\"></figure>",
      scan.id);
}

std::string VerdictText(const std::string& verdict, bool review) {
  if (verdict == "in_tolerance") return review ? "WAS IN TOLERANCE" : "IN TOLERANCE";
  if (verdict == "unsure") return review ? "WAS NOT SURELY WITHIN" : "NOT SURELY WITHIN";
  if (verdict == "move") return review ? "WAS OUTSIDE TOLERANCE" : "MOVE";
  return "NO ANSWER";
}

/// Content of the page.
struct Records {
  PatientService& patients;
  ReferenceService& references;
  ScanService& scans;
};

/// @param newer  A later scan without a result; null if there is none.
/// @param runs   A new scan is running or being computed.
/// @param named  Requested by its number, for reading or printing.
std::string ResultBody(const Records& records, const Scan& scan, const Scan* newer, bool runs,
                       bool named) {
  const auto patient = records.patients.FindPatient(scan.patient_id);
  const auto reference = records.references.FindReference(scan.reference_id);
  const auto age = WallClock::now() - scan.finished_at.value_or(scan.started_at);
  const bool is_known = age >= age.zero();  // otherwise the clock has stepped
  const bool old = !is_known || age > kOldAfter || newer != nullptr || runs;
  const std::string when =
      is_known ? fmt::format("{} min ago", std::chrono::floor<std::chrono::minutes>(age).count())
               : "at an unknown time: the clock has stepped";
  std::string body;
  if (newer != nullptr) {
    body += fmt::format(
        "<p role=\"alert\"><strong>NO ANSWER</strong> from the last scan, of {}: {} What follows "
        "is from before it.</p>",
        TimeText(newer->started_at), EscapeHtml(newer->failure));
  }
  if (runs)
    body +=
        "<p role=\"alert\"><strong>A new scan is running.</strong> What follows is no longer "
        "valid.</p>";
  body += fmt::format("<h1>Patient {}</h1><p>Scan {} of {}, {}.{}</p>",
                      patient ? EscapeHtml(patient->code) : "none", EscapeHtml(scan.id),
                      TimeText(scan.started_at), when,
                      old ? " <strong>OLD: do not act on it.</strong>" : "");
  if (!scan.accepted_by.empty())
    body += fmt::format("<p>Accepted by {}{}{}.</p>", EscapeHtml(scan.accepted_by),
                        scan.accepted_at ? ", " + TimeText(*scan.accepted_at) : "",
                        scan.accepted_reason.empty()
                            ? ""
                            : " outside tolerance: " + EscapeHtml(scan.accepted_reason));
  if (scan.check_overdue) body += "<p>The daily check was overdue at this scan.</p>";
  if (scan.outcome != ScanOutcome::kDone)
    return body + fmt::format(
                      "<section class=\"old\"><p class=\"verdict no_answer\">NO "
                      "ANSWER</p><p>{}</p></section>",
                      EscapeHtml(scan.failure));
  if (reference)
    body += fmt::format("<p>Reference version {} of {}, approved by {}.</p>", reference->version,
                        TimeText(reference->created_at), EscapeHtml(reference->approved_by));
  if (!scan.result) return body + "<p>No comparison: this scan has no reference.</p>";
  const std::string& verdict = scan.result->verdict;
  const bool review = old || named;
  body += fmt::format("<section class=\"{}\"><p class=\"verdict {}\">{}</p>", old ? "old" : "fresh",
                      EscapeHtml(scan.result->verdict), VerdictText(verdict, review));
  for (const std::string& reason : scan.result->reasons)
    body += fmt::format("<p>{}</p>", EscapeHtml(reason));
  return body +
         NumbersTable(*scan.result, reference ? reference->plan.tolerance : Tolerance{}, review) +
         BodyList(*scan.result) + Pictures(scan) + "</section>";
}

/// The newest completed scan if none is named; a later failed one is mentioned.
Response ResultPage(const Records& records, const std::optional<std::string>& wanted, bool runs) {
  std::optional<Scan> scan, failed;
  if (wanted) {
    scan = records.scans.FindScan(*wanted);
  } else {
    for (Scan& candidate : records.scans.Scans("", 20)) {
      if (candidate.outcome == ScanOutcome::kFailed && !failed) failed = candidate;
      if (candidate.outcome != ScanOutcome::kDone) continue;
      scan = std::move(candidate);
      break;
    }
    if (!scan) std::swap(scan, failed);
  }
  Response response;
  response.type = "text/html; charset=utf-8";
  // A page for a named scan is read or printed, so it does not reload itself.
  response.body = Document(
      scan ? ResultBody(records, *scan, failed ? &*failed : nullptr, runs, wanted.has_value())
           : "<h1>No result yet</h1>",
      wanted ? "" : "/result?again");
  if (scan) response.about = scan->id;
  return response;
}

}  // namespace

void AddResultPage(Router& router, const Services& services) {
  const Records records{services.patients, services.references, services.scans};
  router.Add(
      {"GET", "/result", Permission::kNone, BodyKind::kNone,
       [records, &appliance = services.appliance, &accounts = services.accounts,
        &background = services.background](const Request& request, const Respond& respond) {
         if (!request.session) {
           Response response;
           response.type = "text/html; charset=utf-8";
           if (const std::string why = accounts.WhyUnreadable(); !why.empty()) {
             response.status = 503;
             response.body =
                 Document(fmt::format("<h1>Out of order</h1><p role=\"alert\">Nobody can log in or "
                                      "scan until this is put right: {}</p>",
                                      EscapeHtml(why)));
             return respond(std::move(response));
           }
           response.body = Document(LoginForm(
               request.query.contains("failed")  ? "Name or password is wrong."
               : request.query.contains("first") ? "Somebody else chose this password: log in on "
                                                   "the page with script once, and change it."
                                                 : ""));
           return respond(std::move(response));
         }
         const auto named = request.query.find("scan");
         const auto wanted =
             named == request.query.end() ? std::nullopt : std::optional(named->second);
         const ApplianceState state = appliance.GetStatus().state;
         const bool runs = state == ApplianceState::kScanning || state == ApplianceState::kWorking;
         RespondAside(
             background, "GET /result",
             [records, wanted, runs] { return ResultPage(records, wanted, runs); }, respond);
       }});
}

}  // namespace plumb::web
