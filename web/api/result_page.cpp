// The last result as plain HTML: for browsers without script, and for printing.
#include <fmt/format.h>

#include <array>
#include <cmath>

#include "algo/base/digits.hpp"
#include "web/api/api.hpp"
#include "web/api/display_view.hpp"
#include "web/api/json.hpp"
#include "web/api/local_time.hpp"
#include "web/api/result_words.hpp"
#include "web/assets/assets.hpp"
#include "web/assets/spanish.hpp"
#include "web/http/checks.hpp"
#include "web/http/gate.hpp"
#include "web/model/account.hpp"
#include "web/model/limits.hpp"
#include "web/model/numbers.hpp"
#include "web/model/patient.hpp"
#include "web/model/reference.hpp"
#include "web/model/scan.hpp"
#include "web/model/status.hpp"
#include "web/model/wall_clock.hpp"
#include "web/security/password_rules.hpp"

namespace plumb::web {
namespace {

constexpr std::chrono::seconds kRefreshEvery{10};

/// A pattern of the words, filled in.
template <typename... Values>
std::string Filled(std::string_view pattern, const Values&... values) {
  return fmt::format(fmt::runtime(pattern), values...);
}

/// The appliance's "-8.0 mm" and "1 deg" as the table has them: "\u22128.0 mm", "1\u00b0".
std::string Typeset(std::string text) {
  const auto digit = [&](std::size_t at) {
    return at < text.size() && text[at] >= '0' && text[at] <= '9';
  };
  constexpr std::string_view kDegrees = " deg";
  for (std::size_t at = text.find(kDegrees); at != std::string::npos;
       at = text.find(kDegrees, at + 1)) {
    const std::size_t end = at + kDegrees.size();
    const bool is_word =
        end == text.size() || std::string_view(" ,;:.)").find(text[end]) != std::string_view::npos;
    if (at > 0 && digit(at - 1) && is_word) text.replace(at, kDegrees.size(), "\u00b0");
  }
  for (std::size_t at = text.find(" -"); at != std::string::npos; at = text.find(" -", at + 1))
    if (digit(at + 2)) text.replace(at, 2, " \u2212");
  return text;
}

/// Words of the appliance, in the page's language, for HTML.
std::string Said(const std::string& text, const ResultWords& words) {
  const bool is_spanish = &words == &ResultWordsOf(Language::kSpanish);
  return EscapeHtml(Typeset(is_spanish ? InSpanish(text).value_or(text) : text));
}

/// @param query      Query of this page, for the link to it in the other language.
/// @param refreshes  Reloads the page, without counting as use, because its content may be
/// outdated.
std::string Document(const ResultWords& words, const std::string& body, const std::string& query,
                     bool refreshes = false) {
  std::string style;
  for (const Asset& asset : Assets()) {
    if (asset.type.starts_with("text/css"))
      style += fmt::format("<link rel=\"stylesheet\" href=\"{}\">", asset.path);
  }
  return fmt::format(
      "<!doctype html><html lang=\"{}\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width\"><title>{}</title>{}{}</head><body class=\"plain\">"
      "<aside class=\"notice\" aria-label=\"{}\"><p>{}</p></aside><main>{}"
      "<p class=\"languages\"><a href=\"/result?{}language={}\" lang=\"{}\" hreflang=\"{}\">{}"
      "</a></p></main></body></html>",
      words.code, words.title,
      refreshes ? fmt::format("<meta http-equiv=\"refresh\" "
                              "content=\"{};url=/result?again&amp;language={}\">",
                              kRefreshEvery.count(), words.code)
                : "",
      style, words.notice_label, words.terms.notice, body, query, words.other_code,
      words.other_code, words.other_code, words.other);
}

std::string LoginForm(const ResultWords& words, std::string_view trouble) {
  return fmt::format(
      "<h1>{}</h1>{}<form method=\"post\" action=\"/login\" class=\"card form\">"
      "<label>{} <input name=\"name\" autocomplete=\"username\" required "
      "maxlength=\"{}\"></label>"
      "<label>{} <input name=\"password\" type=\"password\" "
      "autocomplete=\"current-password\" required maxlength=\"{}\"></label>"
      "<button class=\"primary\">{}</button></form>",
      words.log_in, trouble.empty() ? "" : fmt::format("<p role=\"alert\">{}</p>", trouble),
      words.name, kMaxName, words.password, kMaxPassword, words.log_in);
}

/// A row of the table. Only the verdict MOVE asks for moves.
std::string NumberCells(std::size_t i, const ResultSummary& result, std::string_view name,
                        const Tolerance& tolerances, const ResultWords& words) {
  const NumberAxis& axis = kNumberAxes[i];
  const std::optional<double> value = axis.In(result.correction);
  if (!value)
    return fmt::format(
        "<tr><th scope=\"row\">{}</th><td>{}</td><td></td><td></td><td></td><td></td></tr>", name,
        words.terms.not_known);
  const double u95 = axis.In(result.u95).value_or(0.0), size = std::abs(*value);
  const double tolerance = axis.is_shift() ? tolerances.shift_mm : tolerances.rotation_deg;
  const char decimal = words.terms.decimal;
  const ShownNumber shown = Shown(*value, u95, axis.is_shift() ? 1 : 2, decimal);
  const std::string unit = axis.is_shift() ? " mm" : axis.symbol();
  const bool in = size + u95 <= tolerance, unsure = !in && size <= tolerance;
  const std::string way = result.verdict != Verdict::kMove
                              ? std::string(unsure ? words.terms.scan_again : words.terms.no_move)
                          : shown.is_zero ? std::string(words.no_change)
                          : size <= u95   ? std::string(words.terms.insignificant)
                                          : Said(result.words[i], words);
  // A narrow window has no heads above the numbers: what a bare "±" means stands beside it.
  return fmt::format(
      "<tr><th scope=\"row\">{}</th><td>{}{}</td><td data-label=\"{}\">{}</td>"
      "<td data-label=\"{}\">\u00b1{}{}</td><td>{}</td><td>{}</td></tr>",
      name, shown.value, unit, words.heads[2],
      shown.u95.empty() ? std::string(words.terms.not_known) : "\u00b1" + shown.u95 + unit,
      words.heads[3], PlainNumber(tolerance, decimal), unit,
      in       ? words.terms.within
      : unsure ? words.terms.not_surely
               : words.terms.outside,
      way);
}

/// @param review  The page is for reading or printing, or the result can no longer be acted on.
std::string_view TableTitle(Verdict verdict, bool review, const ResultWords& words) {
  if (verdict == Verdict::kMove) return review ? words.found_then : words.to_apply;
  if (verdict == Verdict::kInTolerance) return review ? words.remained_then : words.remaining;
  return review ? words.measured_then : words.measured;
}

/// A correction without an answer must not be applied, so it is left out.
std::string NumbersTable(const ResultSummary& result, const std::array<std::string, 6>& names,
                         const Tolerance& tolerance, bool review, const ResultWords& words) {
  if (!result.correction || result.verdict == Verdict::kNoAnswer) return "";
  std::string rows, heads;
  for (std::size_t i = 0; i < names.size(); ++i)
    rows += NumberCells(i, result, EscapeHtml(names[i]), tolerance, words);
  for (const std::string_view head : words.heads)
    heads += fmt::format("<th scope=\"col\">{}</th>", head);
  return fmt::format(
      "<table><caption>{}</caption><thead><tr>{}</tr></thead><tbody>{}</tbody></table>",
      TableTitle(result.verdict, review, words), heads, rows);
}

std::string BodyList(const ResultSummary& result, const ResultWords& words) {
  if (!result.correction || result.verdict == Verdict::kNoAnswer) return "";
  const auto list = [&](std::string_view title, const std::vector<std::string>& parts) {
    std::string items;
    for (const std::string& part : parts) items += fmt::format("<li>{}</li>", Said(part, words));
    if (items.empty())
      items = fmt::format("<li class=\"fine-part\">{}</li>", words.terms.as_reference);
    return fmt::format("<h3>{}</h3><ul class=\"findings\">{}</ul>", title, items);
  };
  return fmt::format("<h2>{}</h2>", words.where) + list(words.terms.posture, result.body_after) +
         list(words.now, result.body_now);
}

std::string Pictures(const Scan& scan, const ResultWords& words) {
  std::error_code ignored;
  if (!std::filesystem::exists(scan.folder / "result/error_map.png", ignored)) return "";
  return fmt::format(
      "<figure><img src=\"/api/v1/scans/{0}/files/error_map.png?language={3}\" "
      "alt=\"{1}\"></figure>"
      "<figure><img src=\"/api/v1/scans/{0}/files/overlay.png?language={3}\" alt=\"{2}\"></figure>",
      scan.id, words.map, words.overlay, words.code);
}

std::string_view VerdictText(Verdict verdict, bool review, const ResultWords& words) {
  const VerdictWords* said = verdict == Verdict::kInTolerance ? &words.in_tolerance
                             : verdict == Verdict::kUnsure    ? &words.unsure
                             : verdict == Verdict::kMove      ? &words.move
                                                              : nullptr;
  if (said == nullptr) return words.terms.no_answer;
  return review ? said->then : said->now;
}

/// Content of the page.
struct Records {
  PatientService& patients;
  ReferenceService& references;
  ScanService& scans;
};

/// A request for the page.
struct Wanted {
  std::optional<std::string> scan;  ///< Number of the scan to read or print; not set: the newest.
  Status status;                    ///< At the time of the request.
  bool is_display = false;          ///< Requested by a display in the room.
  Language language = Language::kEnglish;
  const ResultWords& words = ResultWordsOf(language);

  /// A new scan is running or being computed.
  [[nodiscard]] bool runs() const {
    return status.state == ApplianceState::kScanning || status.state == ApplianceState::kWorking;
  }
};

/// Time since the end of the scan by the appliance's steady clock; not set for a scan that is not
/// the last one since its start.
std::optional<double> SteadyAge_s(const Scan& scan, const Status& status) {
  return status.last_result && status.last_result->id == scan.id ? status.last_result->age_s
                                                                 : std::nullopt;
}

/// Whether the result must not be acted on. The wall clock does not count, because it may have been
/// changed.
/// @param has_newer  A later scan has ended without a result.
bool IsOld(const Scan& scan, bool has_newer, const Wanted& wanted) {
  const std::optional<double> age_s = SteadyAge_s(scan, wanted.status);
  const std::optional<TreatmentSession>& session = wanted.status.session;
  const bool is_on_couch =
      scan.patient_id.empty() || (session && session->patient_id == scan.patient_id);
  return !age_s || *age_s > kResultValid_s || has_newer || wanted.runs() || !is_on_couch;
}

/// "5 min ago": by the steady clock if that has measured it, otherwise by the wall clock.
std::string AgoText(const Scan& scan, const Wanted& wanted) {
  std::chrono::duration<double> age = WallClock::now() - scan.finished_at.value_or(scan.started_at);
  if (const auto steady_s = SteadyAge_s(scan, wanted.status))
    age = std::chrono::duration<double>(*steady_s);
  if (age < age.zero()) return std::string(wanted.words.ago_unknown);
  return Filled(wanted.words.ago_min, std::chrono::floor<std::chrono::minutes>(age).count());
}

std::string AcceptedLine(const Scan& scan, const ResultWords& words) {
  if (scan.accepted_by.empty()) return "";
  const std::string who =
      EscapeHtml(scan.accepted_by) +
      (scan.accepted_at ? ", " + LocalTimeText(*scan.accepted_at) : std::string());
  return fmt::format("<p>{}</p>",
                     scan.accepted_reason.empty()
                         ? Filled(words.accepted_by, who)
                         : Filled(IsUnsure(scan) ? words.accepted_unsure : words.accepted_outside,
                                  who, EscapeHtml(scan.accepted_reason)));
}

/// Version and time of the reference, and who approved it, when.
std::string ReferenceLine(const Reference& reference, const ResultWords& words) {
  const std::string who =
      EscapeHtml(reference.approved_by) +
      (reference.approved_at ? ", " + LocalTimeText(*reference.approved_at) : std::string());
  return fmt::format("<p>{}</p>", Filled(words.reference_line, reference.version,
                                         LocalTimeText(reference.created_at), who));
}

/// Patient, number and age of the scan, and who accepted it.
/// @param newer  A later scan without a result; null if there is none.
std::string Identity(const Records& records, const Scan& scan, const Scan* newer, bool old,
                     const Wanted& wanted) {
  const ResultWords& words = wanted.words;
  const auto patient = records.patients.FindPatient(scan.patient_id);
  std::string text;
  if (newer != nullptr) {
    text += fmt::format(
        "<p role=\"alert\">{}</p>",
        Filled(words.newer_failed, LocalTimeText(newer->started_at), Said(newer->failure, words)));
  }
  if (wanted.runs()) text += fmt::format("<p role=\"alert\">{}</p>", words.running);
  text += fmt::format(
      "<h1>{}</h1><p>{}{}{}</p>",
      patient ? Filled(words.patient, EscapeHtml(patient->code)) : std::string(words.no_patient),
      scan.fraction > 0 ? Filled(words.fraction, scan.fraction) + " " : "",
      Filled(words.scan_line, EscapeHtml(scan.id), LocalTimeText(scan.started_at),
             AgoText(scan, wanted)),
      old ? fmt::format(" <strong>{}</strong>", words.old) : "");
  return text + AcceptedLine(scan, words);
}

/// @param newer      A later scan without a result that is mentioned; null if there is none.
/// @param has_newer  There is one, whether it is mentioned or not.
std::string ResultBody(const Records& records, const Scan& scan, const Scan* newer, bool has_newer,
                       const Wanted& wanted) {
  const ResultWords& words = wanted.words;
  const bool old = scan.result && IsOld(scan, has_newer, wanted);
  std::string body = Identity(records, scan, newer, old, wanted);
  if (scan.outcome != ScanOutcome::kDone)
    return body + fmt::format(
                      "<section class=\"old\"><p class=\"verdict no_answer\">{}</p>"
                      "<p>{}</p></section>",
                      words.terms.no_answer, Said(scan.failure, words));
  const auto reference = records.references.FindReference(scan.reference_id);
  if (reference) body += ReferenceLine(*reference, words);
  if (!scan.result) return body + fmt::format("<p>{}</p>", words.no_reference);
  const Verdict verdict = scan.result->verdict;
  const bool review = old || wanted.scan.has_value();
  body += fmt::format("<section class=\"{}\"><p class=\"verdict {}\">{}</p>", old ? "old" : "fresh",
                      Name(verdict), VerdictText(verdict, review, words));
  for (const std::string& reason : scan.result->reasons)
    body += fmt::format("<p>{}</p>", Said(reason, words));
  const ResultNotes notes = records.scans.Notes(scan.id, wanted.language);
  for (const std::string& caution : notes.cautions)
    body += fmt::format("<p class=\"caution\">{}</p>", EscapeHtml(caution));
  return body +
         NumbersTable(*scan.result, notes.axes, reference ? reference->plan.tolerance : Tolerance{},
                      review, words) +
         BodyList(*scan.result, words) + Pictures(scan, words) + "</section>";
}

/// The scan that is named, else the newest completed one; a later failed one is mentioned.
Response ResultPage(const Records& records, const Wanted& wanted) {
  constexpr int kLookedThrough = 20;
  const auto may_show = [&](const Scan& one) {
    return !wanted.is_display || IsForDisplay(one, wanted.status);
  };
  std::optional<Scan> scan, failed;
  bool has_newer = false;
  for (Scan& candidate : records.scans.Scans("", kLookedThrough)) {
    const bool is_wanted =
        wanted.scan ? candidate.id == *wanted.scan : candidate.outcome == ScanOutcome::kDone;
    if (is_wanted) {
      if (may_show(candidate)) scan = std::move(candidate);
      break;
    }
    if (candidate.outcome != ScanOutcome::kFailed) continue;
    has_newer = true;
    if (!failed && may_show(candidate)) failed = std::move(candidate);
  }
  if (!scan && wanted.scan) {
    scan = records.scans.FindScan(*wanted.scan);
    if (scan && !may_show(*scan)) scan.reset();
  }
  // If a scan is named, only that one is read or printed.
  if (wanted.scan) failed.reset();
  if (!scan) std::swap(scan, failed);
  // A page for a named scan is read or printed, so it does not reload itself.
  Response response = BodyResponse(
      "text/html; charset=utf-8",
      Document(wanted.words,
               scan ? ResultBody(records, *scan, failed ? &*failed : nullptr, has_newer, wanted)
                    : fmt::format("<h1>{}</h1>", wanted.words.none),
               scan && wanted.scan ? fmt::format("scan={}&amp;", scan->id) : "", !wanted.scan));
  if (scan) response.about = scan->id;
  return response;
}

/// The language that the address names ("?language=es"), else the one that the browser prefers.
Language LanguageOf(const Request& request) {
  const auto found = request.query.find("language");
  if (found == request.query.end()) return PreferredLanguage(request.Header("accept-language"));
  return found->second == "es" ? Language::kSpanish : Language::kEnglish;
}

/// @param why_none  Why nobody can log in; empty: they can.
Response LoginPage(const Request& request, const ResultWords& words, const std::string& why_none) {
  const std::string body =
      !why_none.empty() ? fmt::format("<h1>{}</h1><p role=\"alert\">{}</p>", words.out_of_order,
                                      Filled(words.nobody_can, Said(why_none, words)))
                        : LoginForm(words, request.query.contains("failed")  ? words.wrong_password
                                           : request.query.contains("first") ? words.first_password
                                                                             : "");
  Response response = BodyResponse("text/html; charset=utf-8", Document(words, body, ""));
  if (!why_none.empty()) response.status = 503;
  return response;
}

}  // namespace

void AddResultPage(Routes& routes, const Services& services) {
  const Records records{services.patients, services.references, services.scans};
  routes
      .Add(
          "GET", "/result", Permission::kNone, BodyKind::kNone,
          [records, &appliance = services.appliance, &accounts = services.accounts,
           &background = services.background](const Request& request, const Respond& respond) {
            const Language language = LanguageOf(request);
            if (!request.session)
              return respond(LoginPage(request, ResultWordsOf(language), accounts.WhyUnreadable()));
            const auto named = request.query.find("scan");
            const Wanted wanted{
                .scan = named == request.query.end() ? std::nullopt : std::optional(named->second),
                .status = appliance.GetStatus(),
                .is_display = request.session->role == Role::kDisplay,
                .language = language};
            RespondInBackground(
                background, "GET /result",
                [records, wanted] { return ResultPage(records, wanted); }, respond);
          })
      .Discloses("view.scan");
}

}  // namespace plumb::web
