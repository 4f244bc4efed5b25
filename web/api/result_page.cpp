// SPDX-License-Identifier: Apache-2.0
// The last result as plain HTML: for browsers without script, and for printing.
#include <fmt/format.h>

#include <array>
#include <cmath>

#include "algo/base/digits.hpp"
#include "web/api/all_routes.hpp"
#include "web/api/display_view.hpp"
#include "web/exchange/json.hpp"
#include "web/exchange/local_time.hpp"
#include "web/exchange/preferred_language.hpp"
#include "web/http/checks.hpp"
#include "web/http/gate.hpp"
#include "web/model/account.hpp"
#include "web/model/couch.hpp"
#include "web/model/limits.hpp"
#include "web/model/numbers.hpp"
#include "web/model/patient.hpp"
#include "web/model/reference.hpp"
#include "web/model/scan.hpp"
#include "web/model/status.hpp"
#include "web/model/wall_clock.hpp"
#include "web/page/assets.hpp"
#include "web/security/password_rules.hpp"
#include "web/service/result_terms.hpp"
#include "words/result.hpp"

namespace plumb::web {
namespace {

constexpr std::chrono::seconds kRefreshEvery{10};

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
std::string Said(const Message& message, const Catalogue& language) {
  return EscapeHtml(Typeset(Text(message, language)));
}

/// Links to this page in the other languages.
std::string LanguageLinks(const std::string& query, const Catalogue& language) {
  std::string links;
  for (const Catalogue* other : Catalogues()) {
    if (other->code == language.code) continue;
    links +=
        fmt::format("<a href=\"/result?{0}language={1}\" lang=\"{1}\" hreflang=\"{1}\">{2}</a> ",
                    query, other->code, other->name);
  }
  return links;
}

/// @param query      Query of this page, for the links to it in the other languages.
/// @param refreshes  Reloads the page, without counting as use, because its content may be
/// outdated.
std::string Document(const Catalogue& language, const std::string& body, const std::string& query,
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
      "<p class=\"languages\">{}</p></main></body></html>",
      language.code, Word(say::result::kPageTitle, language),
      refreshes ? fmt::format("<meta http-equiv=\"refresh\" "
                              "content=\"{};url=/result?again&amp;language={}\">",
                              kRefreshEvery.count(), language.code)
                : "",
      style, Word(say::result::kPageNoticeLabel, language), Word(say::result::kNotice, language),
      body, LanguageLinks(query, language));
}

std::string LoginForm(const Catalogue& language, const std::string& trouble) {
  return fmt::format(
      "<h1>{}</h1>{}<form method=\"post\" action=\"/login\" class=\"card form\">"
      "<label>{} <input name=\"name\" autocomplete=\"username\" required "
      "maxlength=\"{}\"></label>"
      "<label>{} <input name=\"password\" type=\"password\" "
      "autocomplete=\"current-password\" required maxlength=\"{}\"></label>"
      "<label>{} <input name=\"second_factor\" autocomplete=\"one-time-code\" "
      "maxlength=\"32\"></label>"
      "<label>{} <input name=\"presence\" autocomplete=\"off\" maxlength=\"32\"></label>"
      "<button class=\"primary\">{}</button></form>",
      Word(say::result::kPageLogIn, language),
      trouble.empty() ? "" : fmt::format("<p role=\"alert\">{}</p>", trouble),
      Word(say::result::kPageName, language), kMaxName, Word(say::result::kPagePassword, language),
      kMaxPassword, Word(say::result::kPageSecondFactor, language),
      Word(say::result::kPagePresence, language), Word(say::result::kPageLogIn, language));
}

/// A row of the table.
std::string NumberCells(const CouchRow& row, const Catalogue& language) {
  const std::string name = EscapeHtml(Text(row.judged.name, language));
  if (!row.value)
    return fmt::format(
        "<tr><th scope=\"row\">{}</th><td>{}</td><td></td><td></td><td></td><td></td></tr>", name,
        Word(say::result::kNotKnown, language));
  const char decimal = language.decimal;
  const ShownNumber shown = Shown(*row.value, row.u95.value_or(NAN), row.axis.digits, decimal);
  const std::string unit = UnitBehind(row.axis);
  // A narrow window has no heads above the numbers: what a bare "±" means stands beside it.
  return fmt::format(
      "<tr><th scope=\"row\">{}</th><td>{}{}</td><td data-label=\"{}\">{}</td>"
      "<td data-label=\"{}\">\u00b1{}{}</td><td>{}</td><td>{}</td></tr>",
      name, shown.value, unit, Word(say::result::kPageHeadU95, language),
      shown.u95.empty() ? Word(say::result::kNotKnown, language) : "\u00b1" + shown.u95 + unit,
      Word(say::result::kPageHeadTolerance, language), PlainNumber(row.tolerance, decimal), unit,
      Text(JudgementWord(row.judged.judgement), language), Said(row.way, language));
}

/// @param review  The page is for reading or printing, or the result can no longer be acted on.
Message TableTitle(const ResultSummary& result, bool review) {
  const auto title = [&](const auto& now, const auto& then) {
    return review ? then(result.about) : now(result.about);
  };
  if (result.verdict == Verdict::kMove)
    return title(say::result::PageToApply, say::result::PageFoundThen);
  if (result.verdict == Verdict::kInTolerance)
    return title(say::result::PageRemaining, say::result::PageRemainedThen);
  return title(say::result::PageMeasured, say::result::PageMeasuredThen);
}

std::string NumbersTable(const ResultSummary& result, const CouchProfile& couch, bool review,
                         const Catalogue& language) {
  std::string rows, heads, notes;
  for (const CouchRow& row : CouchRows(result, couch))
    if (!row.is_hidden) rows += NumberCells(row, language);
  if (rows.empty()) return "";
  const auto beside = RunsAlongCouch(result) ? CouchNotes(couch) : std::vector<Message>();
  for (const Message& note : beside)
    notes += fmt::format("<p class=\"couch-notes\">{}</p>", Said(note, language));
  for (const MessageId head : {say::result::kPageHeadAxis, say::result::kPageHeadValue,
                               say::result::kPageHeadU95, say::result::kPageHeadTolerance,
                               say::result::kPageHeadAssessment, say::result::kPageHeadDirection})
    heads += fmt::format("<th scope=\"col\">{}</th>", Word(head, language));
  return fmt::format(
      "<table><caption>{}</caption><thead><tr>{}</tr></thead><tbody>{}</tbody></table>{}",
      Said(TableTitle(result, review), language), heads, rows, notes);
}

std::string BodyList(const ResultSummary& result, const Catalogue& language) {
  if (!result.correction || result.verdict == Verdict::kNoAnswer) return "";
  const auto list = [&](const std::string& title, const std::vector<Message>& parts) {
    std::string items;
    for (const Message& part : parts) items += fmt::format("<li>{}</li>", Said(part, language));
    if (items.empty())
      items =
          fmt::format("<li class=\"fine-part\">{}</li>", Word(say::result::kAsReference, language));
    return fmt::format("<h3>{}</h3><ul class=\"findings\">{}</ul>", title, items);
  };
  return fmt::format("<h2>{}</h2>", Word(say::result::kPageWhere, language)) +
         list(Word(say::result::kPosture, language), result.body_after) +
         list(Word(say::result::kPageNow, language), result.body_now);
}

std::string Pictures(const Scan& scan, const Catalogue& language) {
  std::error_code ignored;
  if (!std::filesystem::exists(scan.folder / "result/error_map.png", ignored)) return "";
  return fmt::format(
      "<figure><img src=\"/api/v1/scans/{0}/files/error_map.png?language={3}\" "
      "alt=\"{1}\"></figure>"
      "<figure><img src=\"/api/v1/scans/{0}/files/overlay.png?language={3}\" alt=\"{2}\"></figure>",
      scan.id, Word(say::result::kPageMap, language), Word(say::result::kPageOverlay, language),
      language.code);
}

std::string VerdictText(Verdict verdict, bool review, const Catalogue& language) {
  const auto word = [&](MessageId now, MessageId then) {
    return Word(review ? then : now, language);
  };
  switch (verdict) {
    case Verdict::kInTolerance:
      return word(say::result::kPageInToleranceNow, say::result::kPageInToleranceThen);
    case Verdict::kUnsure:
      return word(say::result::kPageUnsureNow, say::result::kPageUnsureThen);
    case Verdict::kMove:
      return word(say::result::kPageMoveNow, say::result::kPageMoveThen);
    case Verdict::kNoAnswer:
      break;
  }
  return Word(say::result::kNoAnswer, language);
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
  const Catalogue& language;

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
  const bool is_on_couch = scan.patient_id.empty() || (session && session->id == scan.session_id);
  const bool has_other_reference = session && session->reference && !scan.reference_id.empty() &&
                                   session->reference->id != scan.reference_id;
  return !age_s || *age_s > kResultValid_s || has_newer || wanted.runs() || !is_on_couch ||
         wanted.status.last_result->is_superseded || has_other_reference;
}

/// "5 min ago": by the steady clock if that has measured it, otherwise by the wall clock.
std::string AgoText(const Scan& scan, const Wanted& wanted) {
  std::chrono::duration<double> age = WallClock::now() - scan.finished_at.value_or(scan.started_at);
  if (const auto steady_s = SteadyAge_s(scan, wanted.status))
    age = std::chrono::duration<double>(*steady_s);
  if (age < age.zero()) return Word(say::result::kPageAgoUnknown, wanted.language);
  return Text(say::result::PageAgoMin(
                  static_cast<double>(std::chrono::floor<std::chrono::minutes>(age).count())),
              wanted.language);
}

std::string AcceptedLine(const Scan& scan, const Catalogue& language) {
  if (scan.accepted_by.empty()) return "";
  const std::string who =
      EscapeHtml(scan.accepted_by) +
      (scan.accepted_at ? ", " + LocalTimeText(*scan.accepted_at) : std::string());
  const std::string reason = EscapeHtml(scan.accepted_reason);
  const Message line = reason.empty()   ? say::result::PageAcceptedBy(who)
                       : IsUnsure(scan) ? say::result::PageAcceptedUnsure(who, reason)
                                        : say::result::PageAcceptedOutside(who, reason);
  return fmt::format("<p>{}</p>", Text(line, language));
}

/// Version and time of the reference, and who approved it, when.
std::string ReferenceLine(const Reference& reference, const Catalogue& language) {
  const std::string who =
      EscapeHtml(reference.approved_by) +
      (reference.approved_at ? ", " + LocalTimeText(*reference.approved_at) : std::string());
  return fmt::format("<p>{}</p>",
                     Text(say::result::PageReferenceLine(reference.version,
                                                         LocalTimeText(reference.created_at), who),
                          language));
}

/// Patient, number and age of the scan, and who accepted it.
/// @param newer  A later scan without a result; null if there is none.
std::string Identity(const Records& records, const Scan& scan, const Scan* newer, bool old,
                     const Wanted& wanted) {
  const Catalogue& language = wanted.language;
  const auto patient = records.patients.FindPatient(scan.patient_id);
  std::string text;
  if (newer != nullptr) {
    text += fmt::format("<p role=\"alert\">{}</p>",
                        Text(say::result::PageNewerFailed(LocalTimeText(newer->started_at),
                                                          Said(newer->failure, language)),
                             language));
  }
  if (wanted.runs())
    text += fmt::format("<p role=\"alert\">{}</p>", Word(say::result::kPageRunning, language));
  text += fmt::format(
      "<h1>{}</h1><p>{}{}{}</p>",
      patient ? Text(say::result::PagePatient(EscapeHtml(patient->code)), language)
              : Word(say::result::kPageNoPatient, language),
      scan.fraction > 0 ? Text(say::result::PageFraction(scan.fraction), language) + " " : "",
      Text(say::result::PageScanLine(EscapeHtml(scan.id), LocalTimeText(scan.started_at),
                                     AgoText(scan, wanted)),
           language),
      old ? fmt::format(" <strong>{}</strong>", Word(say::result::kPageOld, language)) : "");
  return text + AcceptedLine(scan, language);
}

/// @param newer      A later scan without a result that is mentioned; null if there is none.
/// @param has_newer  There is one, whether it is mentioned or not.
std::string ResultBody(const Records& records, const Scan& scan, const Scan* newer, bool has_newer,
                       const Wanted& wanted) {
  const Catalogue& language = wanted.language;
  const bool old = scan.result && IsOld(scan, has_newer, wanted);
  std::string body = Identity(records, scan, newer, old, wanted);
  if (scan.outcome != ScanOutcome::kDone)
    return body + fmt::format(
                      "<section class=\"old\"><p class=\"verdict no_answer\">{}</p>"
                      "<p>{}</p></section>",
                      Word(say::result::kNoAnswer, language), Said(scan.failure, language));
  const auto reference = records.references.FindReference(scan.reference_id);
  if (reference) body += ReferenceLine(*reference, language);
  if (!scan.result)
    return body + fmt::format("<p>{}</p>", Word(say::result::kPageNoReference, language));
  const Verdict verdict = scan.result->verdict;
  const bool review = old || wanted.scan.has_value();
  body += fmt::format("<section class=\"{}\"><p class=\"verdict {}\">{}</p>", old ? "old" : "fresh",
                      Name(verdict), VerdictText(verdict, review, language));
  for (const Message& reason : scan.result->reasons)
    body += fmt::format("<p>{}</p>", Said(reason, language));
  const ScanQuality quality = records.scans.QualityOf(scan.id);
  for (const auto* list : {&quality.cautions, &quality.remarks})
    for (const Message& caution : *list)
      body += fmt::format("<p class=\"caution\">{}</p>", Said(caution, language));
  return body + NumbersTable(*scan.result, wanted.status.couch, review, language) +
         BodyList(*scan.result, language) + Pictures(scan, language) + "</section>";
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
      Document(wanted.language,
               scan ? ResultBody(records, *scan, failed ? &*failed : nullptr, has_newer, wanted)
                    : fmt::format("<h1>{}</h1>", Word(say::result::kPageNone, wanted.language)),
               scan && wanted.scan ? fmt::format("scan={}&amp;", scan->id) : "", !wanted.scan));
  if (scan) response.about = scan->id;
  return response;
}

/// The language that the address names ("?language=es"), else the one that the browser prefers.
const Catalogue& LanguageOf(const Request& request) {
  const auto found = request.query.find("language");
  if (found == request.query.end()) return PreferredLanguage(request.Header("accept-language"));
  const Catalogue* const named = FindCatalogue(found->second);
  return named != nullptr ? *named : EnglishCatalogue();
}

/// What the form says above its fields.
std::string AboveLoginForm(const Request& request, const Catalogue& language) {
  if (const auto failed = request.query.find("failed"); failed != request.query.end())
    return Word(failed->second == "directory" ? say::result::kPageDirectoryRefuses
                                              : say::result::kPageWrongPassword,
                language);
  if (request.query.contains("first")) return Word(say::result::kPageFirstPassword, language);
  return {};
}

/// @param why_none  Why nobody can log in; empty: they can.
Response LoginPage(const Request& request, const Catalogue& language, const Message& why_none) {
  const std::string body =
      !why_none.empty()
          ? fmt::format("<h1>{}</h1><p role=\"alert\">{}</p>",
                        Word(say::result::kPageOutOfOrder, language),
                        Text(say::result::PageNobodyCan(Said(why_none, language)), language))
          : LoginForm(language, AboveLoginForm(request, language));
  Response response = BodyResponse("text/html; charset=utf-8", Document(language, body, ""));
  if (!why_none.empty()) response.status = 503;
  return response;
}

}  // namespace

void AddResultPage(Routes& routes, const Services& services) {
  const Records records{services.patients, services.references, services.scans};
  routes
      .Add("GET", "/result", Permission::kNone, BodyKind::kNone,
           [records, &appliance = services.appliance, &accounts = services.accounts,
            &background = services.background](const Request& request, const Respond& respond) {
             const Catalogue& language = LanguageOf(request);
             if (!request.session)
               return respond(LoginPage(request, language, accounts.WhyUnreadable()));
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
