// SPDX-License-Identifier: Apache-2.0
// Exports for other programs: the numbers of a patient as CSV and JSON, reports, a whole course as
// one archive.
#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <utility>

#include "web/api/all_routes.hpp"
#include "web/exchange/csv.hpp"
#include "web/exchange/json.hpp"
#include "web/exchange/zip_archive.hpp"
#include "words/store.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

constexpr int kMaxScans = 1000;

std::string Csv(const Patient& patient, const std::vector<Scan>& scans, const Catalogue& language) {
  CsvTable table(language);
  for (const char* name : {"patient", "scan", "fraction", "purpose", "started_at", "verdict"})
    table.Plain(name);
  for (const char* prefix : {"", "u95_"})
    for (const NumberAxis& axis : kNumberAxes) table.Plain(prefix + std::string(axis.key));
  for (const char* name :
       {"accepted_by", "accepted_at", "accepted_reason", "check_overdue", "check_failed"})
    table.Plain(name);
  for (const NumberAxis& axis : kNumberAxes) table.Plain("judgement_" + std::string(axis.name));
  table.EndRow();
  for (auto scan = scans.rbegin(); scan != scans.rend(); ++scan) {
    if (scan->outcome != ScanOutcome::kDone) continue;
    std::vector<ShownRow> rows(kNumberAxes.size());
    const bool is_advice = scan->result && !ShownRows(*scan->result).empty();
    if (is_advice) rows = ShownRows(*scan->result);
    table.Text(patient.code)
        .Text(scan->id)
        .Plain(scan->fraction > 0 ? std::to_string(scan->fraction) : "")
        .Plain(Name(scan->purpose))
        .Plain(TimeText(scan->started_at))
        .Plain(scan->result ? Name(scan->result->verdict) : "");
    for (const ShownRow& row : rows) table.Number(row.value);
    for (const ShownRow& row : rows) table.Number(row.u95);
    table.Text(scan->accepted_by)
        .Plain(scan->accepted_at ? TimeText(*scan->accepted_at) : "")
        .Text(scan->accepted_reason)
        .Plain(scan->daily_check != DailyCheck::kPassed ? "yes" : "no")
        .Plain(scan->daily_check == DailyCheck::kFailed ? "yes" : "no");
    for (const ShownRow& row : rows)
      table.Plain(is_advice ? Name(row.judgement) : std::string_view());
    table.EndRow();
  }
  return table.Take();
}

std::string NumbersJson(const Patient& patient, const std::vector<Scan>& scans) {
  return Dump({{"patient", patient}, {"scans", ListJson(scans, WallClock::now())}});
}

/// By the patient's code, as people file it.
std::string ReportName(PatientService& patients, const Scan& scan) {
  const auto patient = patients.FindPatient(scan.patient_id);
  const std::string fraction = scan.fraction > 0 ? fmt::format("_fraction_{}", scan.fraction) : "";
  return fmt::format("plumb_{}{}_scan_{}.pdf", patient ? patient->code : "unassigned", fraction,
                     scan.id);
}

void AddReports(Routes& routes, PatientService& patients, ScanService& scans) {
  routes
      .ReadInBackground("/api/v1/scans/{id}/report.pdf", Permission::kView,
                        [&patients, &scans](const Request& request) {
                          const auto scan = scans.FindScan(request.arguments[0]);
                          auto pdf = scans.ScanReport(request.arguments[0], LanguageIn(request));
                          if (!pdf || !scan) return ErrorResponse(404, say::store::NoScan());
                          return Download("application/pdf", std::move(*pdf),
                                          ReportName(patients, *scan));
                        })
      .Discloses("", "download.report");
  routes
      .ReadInBackground("/api/v1/patients/{id}/report.pdf", Permission::kView,
                        [&patients, &scans](const Request& request) {
                          const auto patient = patients.FindPatient(request.arguments[0]);
                          auto pdf = scans.CourseReport(request.arguments[0], LanguageIn(request));
                          if (!pdf || !patient) return ErrorResponse(404, say::store::NoPatient());
                          return Download("application/pdf", std::move(*pdf),
                                          fmt::format("plumb_course_{}.pdf", patient->code));
                        })
      .Discloses("", "download.course_report");
}

void AddNumbers(Routes& routes, PatientService& patients, ScanService& scans) {
  routes
      .ReadInBackground(
          "/api/v1/patients/{id}/numbers.csv", Permission::kView,
          [&patients, &scans](const Request& request) {
            const auto patient = patients.FindPatient(request.arguments[0]);
            if (!patient) return ErrorResponse(404, say::store::NoPatient());
            return Download("text/csv; charset=utf-8",
                            Csv(*patient, scans.Scans(patient->id, kMaxScans), LanguageIn(request)),
                            fmt::format("plumb_numbers_{}.csv", patient->code));
          })
      .Discloses("", "download.numbers");
  routes
      .ReadInBackground("/api/v1/patients/{id}/numbers.json", Permission::kView,
                        [&patients, &scans](const Request& request) {
                          const auto patient = patients.FindPatient(request.arguments[0]);
                          if (!patient) return ErrorResponse(404, say::store::NoPatient());
                          return Download(
                              "application/json",
                              NumbersJson(*patient, scans.Scans(patient->id, kMaxScans)),
                              fmt::format("plumb_numbers_{}.json", patient->code));
                        })
      .Discloses("", "download.numbers");
}

constexpr std::size_t kMostBytes = std::size_t{64} << 20;

/// At most `most` bytes of a file; nothing if it is missing or larger.
std::optional<std::string> BytesOf(const std::filesystem::path& file, std::size_t most) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(file, error);
  if (error || size > most) return std::nullopt;
  std::ifstream in(file, std::ios::binary);
  std::string bytes(static_cast<std::size_t>(size), '\0');
  if (!in.read(bytes.data(), static_cast<std::streamsize>(size))) return std::nullopt;
  return bytes;
}

/// Result and pictures of every compared scan, the newest first, as long as there is space; a
/// separate file names what was left out.
void AddResults(const std::vector<Scan>& scans, std::vector<ArchivedFile>& files) {
  std::size_t room = kMostBytes;
  std::string left_out;
  for (const Scan& scan : scans) {
    if (!scan.result) continue;
    if (scan.folder.empty()) {  // compared, but its files are unavailable
      left_out += fmt::format("{}: {}\r\n", scan.id, scan.failure.English());
      continue;
    }
    for (const char* name : {"result.json", "error_map.png", "overlay.png"}) {
      auto bytes = BytesOf(scan.folder / "result" / name, room);
      if (!bytes) {
        left_out += fmt::format("{}/{}\r\n", scan.id, name);
        continue;
      }
      room -= bytes->size();
      files.push_back({.name = fmt::format("scans/{}/{}", scan.id, name),
                       .bytes = std::move(*bytes),
                       .is_compressed = std::string_view(name).ends_with(".png")});
    }
  }
  if (!left_out.empty()) files.push_back({.name = "left_out.txt", .bytes = std::move(left_out)});
}

/// All data of a course in one file.
void AddCourse(Routes& routes, PatientService& patients, ScanService& scans) {
  routes
      .ReadInBackground(
          "/api/v1/patients/{id}/course.zip", Permission::kView,
          [&patients, &scans](const Request& request) {
            const auto patient = patients.FindPatient(request.arguments[0]);
            if (!patient) return ErrorResponse(404, say::store::NoPatient());
            const std::vector<Scan> list = scans.Scans(patient->id, kMaxScans);
            std::vector<ArchivedFile> files = {
                {.name = "numbers.csv", .bytes = Csv(*patient, list, LanguageIn(request))},
                {.name = "numbers.json", .bytes = NumbersJson(*patient, list)}};
            if (auto pdf = scans.CourseReport(patient->id, LanguageIn(request)))
              files.push_back({.name = "course.pdf", .bytes = std::move(*pdf)});
            AddResults(list, files);
            return Download("application/zip", ZipOf(files),
                            fmt::format("plumb_course_{}.zip", patient->code));
          })
      .Discloses("", "download.course");
}

}  // namespace

void AddExportRoutes(Routes& routes, const Services& services) {
  AddReports(routes, services.patients, services.scans);
  AddNumbers(routes, services.patients, services.scans);
  AddCourse(routes, services.patients, services.scans);
}

}  // namespace plumb::web
