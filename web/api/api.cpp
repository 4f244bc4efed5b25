#include "web/api/api.hpp"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <filesystem>
#include <utility>

#include "algo/base/errors.hpp"
#include "web/api/json.hpp"
#include "web/api/look_back.hpp"
#include "web/api/routes.hpp"
#include "web/http/checks.hpp"
#include "web/model/audit.hpp"
#include "web/model/limits.hpp"
#include "web/model/patient.hpp"
#include "web/model/scan.hpp"
#include "web/model/settings.hpp"
#include "web/model/status.hpp"
#include "web/model/wall_clock.hpp"

namespace plumb::web {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxListed = 200;

/// The files of a scan that can be downloaded, and their places in its folder.
struct ScanFile {
  std::string_view name;
  std::string_view path;
  std::string_view type;
};
constexpr std::array kScanFiles = {
    ScanFile{"result.json", "result/result.json", "application/json"},
    ScanFile{"error_map.png", "result/error_map.png", "image/png"},
    ScanFile{"overlay.png", "result/overlay.png", "image/png"},
    ScanFile{"deviation.tiff", "result/deviation.tiff", "image/tiff"},
    ScanFile{"deviation_after.tiff", "result/deviation_after.tiff", "image/tiff"},
    ScanFile{"distance.tiff", "result/distance.tiff", "image/tiff"},
    ScanFile{"deformation.ply", "result/deformation.ply", "application/octet-stream"},
    ScanFile{"scene.json", "scene/scene.json", "application/json"},
    ScanFile{"heightmap.tiff", "scene/heightmap.tiff", "image/tiff"},
    ScanFile{"mesh.ply", "scene/mesh.ply", "application/octet-stream"},
    ScanFile{"cloud.ply", "scene/cloud.ply", "application/octet-stream"},
    ScanFile{"trajectory.txt", "scene/trajectory.txt", "text/plain; charset=utf-8"},
};

std::int64_t QueryNumber(const Request& request, const std::string& name, std::int64_t otherwise,
                         std::int64_t max) {
  const auto found = request.query.find(name);
  if (found == request.query.end()) return otherwise;
  std::int64_t value = 0;
  const char* const end = found->second.data() + found->second.size();
  const auto [stop, error] = std::from_chars(found->second.data(), end, value);
  if (error != std::errc() || stop != end || value < 0 || value > max) {
    throw DataError(fmt::format("{} must be a whole number from 0 to {}", name, max));
  }
  return value;
}

/// @param download_name  Name of the downloaded file; empty: the browser shows it.
Response FileResponse(const fs::path& file, std::string_view type,
                      const std::string& download_name) {
  Response response;
  try {
    response.file = std::make_shared<OpenFile>(file);
  } catch (const IoError&) {
    return ErrorResponse(404, "this scan has no such file");
  }
  response.type = std::string(type);
  NameDownload(response, download_name);
  return response;
}

std::optional<ComparisonPicture> PictureNamed(std::string_view name) {
  if (name == "error_map.png") return ComparisonPicture::kErrorMap;
  if (name == "overlay.png") return ComparisonPicture::kOverlay;
  return std::nullopt;
}

/// Name of the downloaded file; empty if the client wants to show it.
std::string DownloadName(const Request& request) {
  return request.query.contains("download")
             ? fmt::format("{}_{}", request.arguments[0], request.arguments[1])
             : std::string();
}

/// The picture in the requested language. Nothing if none is requested, the file is not a picture,
/// or it cannot be drawn: then the stored file is sent.
std::optional<Response> TranslatedPicture(ScanService& scans, const Request& request) {
  const std::optional<ComparisonPicture> picture = PictureNamed(request.arguments[1]);
  if (!picture || !request.query.contains("language")) return std::nullopt;
  auto png = scans.PictureOf(request.arguments[0], *picture, LanguageIn(request));
  if (!png) return std::nullopt;
  Response response = BodyResponse("image/png", std::move(*png));
  NameDownload(response, DownloadName(request));
  return response;
}

Response ScanFileResponse(ScanService& scans, const std::string& scan_id, std::string_view name,
                          const std::string& download_name) {
  const auto scan = scans.FindScan(scan_id);
  if (!scan) return ErrorResponse(404, "no such scan");
  for (const ScanFile& file : kScanFiles) {
    if (file.name != name) continue;
    if (scan->folder.empty()) return ErrorResponse(404, "the files of this scan no longer exist");
    return FileResponse(scan->folder / file.path, file.type, download_name);
  }
  return ErrorResponse(404, "this scan has no such file");
}

void AddApplianceRoutes(Routes& routes, ApplianceService& appliance) {
  routes.Read("/health", Permission::kNone, [&appliance](const Request&) {
    const Health health = appliance.GetHealth();
    return health.ok
               ? JsonResponse({{"status", "ok"}})
               : JsonResponse({{"status", "failed"}, {"reason", health.reason}}, /*status=*/503);
  });
  routes.Read("/api/v1/status", Permission::kRoom, [&appliance](const Request&) {
    return JsonResponse(ToJson(appliance.GetStatus(), WallClock::now()));
  });
  routes
      .Read("/api/v1/preview", Permission::kRoom,
            [&appliance](const Request&) {
              const auto picture = appliance.Preview();
              if (!picture) return ErrorResponse(404, "there is no camera image at the moment");
              return BodyResponse("image/jpeg", *picture);
            })
      .Discloses("view.camera");
  routes
      .Read("/api/v1/scan/surface", Permission::kRoom,
            [&appliance](const Request&) {
              const auto map = appliance.SweptSurface();
              if (!map) return ErrorResponse(404, "there is no surface of a sweep at the moment");
              return BodyResponse("application/octet-stream", *map);
            })
      .Discloses("view.camera");
  routes.Write("POST", "/api/v1/press", Permission::kScan, BodyKind::kNone,
               [&appliance](const Request& request, const Done& done) {
                 appliance.Press(request.actor(), done);
               });
  routes.Write("POST", "/api/v1/scan/start", Permission::kScan, BodyKind::kNone,
               [&appliance](const Request& request, const Done& done) {
                 appliance.StartSweep(request.actor(), done);
               });
  routes.Write("POST", "/api/v1/scan/end", Permission::kScan, BodyKind::kNone,
               [&appliance](const Request& request, const Done& done) {
                 appliance.EndSweep(request.actor(), done);
               });
  routes.Write("POST", "/api/v1/cancel", Permission::kScan, BodyKind::kNone,
               [&appliance](const Request& request, const Done& done) {
                 appliance.Cancel(request.actor(), done);
               });
}

void AddPatientRoutes(Routes& routes, PatientService& patients, ReferenceService& references,
                      ScanService& scans) {
  routes
      .ReadInBackground("/api/v1/patients", Permission::kView,
                        [&patients](const Request&) {
                          return JsonResponse({{"patients", patients.Patients()}});
                        })
      .Discloses("view.patients");
  routes.Write(
      "POST", "/api/v1/patients", Permission::kPatients, BodyKind::kJson,
      [&patients](const Request& request, const Done& done) {
        Fields fields(request.body);
        const std::string code = fields.Text("code", 1, kMaxName),
                          site = fields.Text("site", 0, kMaxSite);
        fields.Finish();
        if (!IsName(code))
          throw DataError("code must be letters, digits, '.', '-' or '_': a pseudonym, no name");
        patients.AddPatient(request.actor(), code, site, done);
      });
  routes
      .Read("/api/v1/patients/{id}", Permission::kRoom,
            [&patients](const Request& request) {
              const auto patient = patients.FindPatient(request.arguments[0]);
              return patient ? JsonResponse(*patient) : ErrorResponse(404, "no such patient");
            })
      .Discloses("view.patient")
      .ShowsDisplays(ShownRecord::kPatient, "no such patient");
  routes.Write("PUT", "/api/v1/patients/{id}", Permission::kPatients, BodyKind::kJson,
               [&patients](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const CourseNotes wanted{.site = fields.Text("site", 0, kMaxSite),
                                          .note = fields.Text("note", 0, kMaxNote)};
                 std::optional<CourseNotes> shown;
                 if (fields.Has("site_before") || fields.Has("note_before"))
                   shown = {.site = fields.Text("site_before", 0, kMaxSite),
                            .note = fields.Text("note_before", 0, kMaxNote)};
                 fields.Finish();
                 patients.ChangePatient(request.actor(), request.arguments[0], wanted, shown, done);
               });
  routes.Write("POST", "/api/v1/patients/{id}/archive", Permission::kPlan, BodyKind::kJson,
               [&patients](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const bool archived = fields.Flag("archived");
                 fields.Finish();
                 patients.ArchivePatient(request.actor(), request.arguments[0], archived, done);
               });
  routes.Write("POST", "/api/v1/patients/{id}/open", Permission::kScan, BodyKind::kJson,
               [&patients](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const ScanPurpose purpose = ParsePurpose(fields.Text("purpose", 1, 32));
                 const std::string reason = fields.Text("reason", 0, kMaxReason);
                 const std::string replaces =
                     fields.Has("replaces") ? fields.Text("replaces", 0, 64) : std::string();
                 fields.Finish();
                 patients.OpenPatient(request.actor(), request.arguments[0], purpose, reason,
                                      replaces, [done](Change change) {
                                        // the status states which session is open
                                        change.id.clear();
                                        done(change);
                                      });
               });
  routes.Write("POST", "/api/v1/treatment/close", Permission::kScan, BodyKind::kJson,
               [&patients](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const std::string session = fields.Text("session_id", 0, 64);
                 fields.Finish();
                 patients.CloseSession(request.actor(), session, done);
               });
  routes
      .ReadInBackground(
          "/api/v1/patients/{id}/references", Permission::kView,
          [&patients, &references](const Request& request) {
            if (!patients.FindPatient(request.arguments[0]))
              return ErrorResponse(404, "no such patient");
            return JsonResponse({{"references", references.References(request.arguments[0])}});
          })
      .Discloses("view.patient");
  routes
      .ReadInBackground(
          "/api/v1/patients/{id}/scans", Permission::kView,
          [&patients, &scans](const Request& request) {
            if (!patients.FindPatient(request.arguments[0]))
              return ErrorResponse(404, "no such patient");
            return JsonResponse({{"scans", ListJson(scans.Scans(request.arguments[0], kMaxListed),
                                                    WallClock::now())}});
          })
      .Discloses("view.patient");
}

void AddTemplateRoutes(Routes& routes, SettingsService& settings) {
  routes.Read("/api/v1/templates", Permission::kView, [&settings](const Request&) {
    return JsonResponse({{"templates", settings.Templates()}});
  });
  routes.Write("PUT", "/api/v1/templates", Permission::kPlan, BodyKind::kJson,
               [&settings](const Request& request, const Done& done) {
                 settings.SetTemplate(request.actor(), ParseTemplate(request.body), done);
               });
  routes.Write("POST", "/api/v1/templates/remove", Permission::kPlan, BodyKind::kJson,
               [&settings](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const std::string site = fields.Text("site", 1, kMaxSite);
                 fields.Finish();
                 settings.RemoveTemplate(request.actor(), site, done);
               });
}

void AddReferenceRoutes(Routes& routes, ReferenceService& references) {
  routes.Write("POST", "/api/v1/references", Permission::kPlan, BodyKind::kJson,
               [&references](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const std::string scan_id = fields.Text("scan_id", 1, 64),
                                   reason = fields.Text("reason", 0, kMaxReason);
                 fields.Finish();
                 references.AddReference(request.actor(), scan_id, reason, done);
               });
  routes
      .ReadInBackground("/api/v1/references/{id}", Permission::kRoom,
                        [&references](const Request& request) {
                          const auto reference = references.FindReference(request.arguments[0]);
                          if (!reference) return ErrorResponse(404, "no such reference");
                          Json json = *reference;
                          json["room"] = references.RoomOfReference(*reference);
                          return JsonResponse(json);
                        })
      .Discloses("view.reference")
      .ShowsDisplays(ShownRecord::kReference, "no such reference");
  routes.Write("PUT", "/api/v1/references/{id}/plan", Permission::kPlan, BodyKind::kJson,
               [&references](const Request& request, const Done& done) {
                 const auto [plan, revision] = ParsePlan(request.body);
                 references.PlanReference(request.actor(), request.arguments[0], revision, plan,
                                          done);
               });
}

void AddScanRoutes(Routes& routes, ScanService& scans) {
  routes
      .ReadInBackground(
          "/api/v1/scans", Permission::kView,
          [&scans](const Request& request) {
            const auto limit =
                static_cast<int>(QueryNumber(request, "limit", kMaxListed, kMaxListed));
            return JsonResponse({{"scans", ListJson(scans.Scans("", limit), WallClock::now())}});
          })
      .Discloses("view.scans");
  routes
      .Read("/api/v1/scans/{id}", Permission::kRoom,
            [&scans](const Request& request) {
              const auto scan = scans.FindScan(request.arguments[0]);
              return scan ? JsonResponse(ToJson(*scan, WallClock::now()))
                          : ErrorResponse(404, "no such scan");
            })
      .Discloses("view.scan")
      .ShowsDisplays(ShownRecord::kScan, "no such scan");
  routes.Write("DELETE", "/api/v1/scans/{id}", Permission::kWipe, BodyKind::kJson,
               [&scans](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const std::string reason = fields.Text("reason", kMinReason, kMaxReason);
                 fields.Finish();
                 scans.RemoveScan(request.actor(), request.arguments[0], reason, done);
               });
  routes.Write("POST", "/api/v1/scans/{id}/accept", Permission::kAccept, BodyKind::kNone,
               [&scans](const Request& request, const Done& done) {
                 scans.AcceptScan(request.actor(), request.arguments[0], /*reason=*/{}, done);
               });
  routes
      .ReadInBackground("/api/v1/scans/{id}/files/{name}", Permission::kRoom,
                        [&scans](const Request& request) {
                          if (auto picture = TranslatedPicture(scans, request))
                            return std::move(*picture);
                          return ScanFileResponse(scans, request.arguments[0], request.arguments[1],
                                                  DownloadName(request));
                        })
      .Discloses("view.scan", "download.file")
      .ShowsDisplays(ShownRecord::kScanFile, "no such scan");
  routes
      .ReadInBackground("/api/v1/scans/{id}/maps/{name}", Permission::kRoom,
                        [&scans](const Request& request) {
                          auto map = scans.CompactMap(request.arguments[0], request.arguments[1]);
                          if (!map) return ErrorResponse(404, "this scan has no such map");
                          return BodyResponse("application/octet-stream", std::move(*map));
                        })
      .Discloses("view.scan")
      .ShowsDisplays(ShownRecord::kScan, "this scan has no such map");
  routes
      .ReadInBackground("/api/v1/results/{id}", Permission::kRoom,
                        [&scans](const Request& request) {
                          return ScanFileResponse(scans, request.arguments[0], "result.json",
                                                  /*download_name=*/"");
                        })
      .Discloses("view.scan")
      .ShowsDisplays(ShownRecord::kScan, "no such scan");
}

void AddCheckRoutes(Routes& routes, CheckService& checks) {
  routes.ReadInBackground("/api/v1/checks", Permission::kView, [&checks](const Request&) {
    return JsonResponse(ToJson(checks.GetChecks(), WallClock::now()));
  });
  routes.Write("POST", "/api/v1/checks/open", Permission::kScan, BodyKind::kNone,
               [&checks](const Request& request, const Done& done) {
                 checks.OpenCheck(request.actor(), done);
               });
  routes.Write("POST", "/api/v1/checks/{id}/baseline", Permission::kPlan, BodyKind::kNone,
               [&checks](const Request& request, const Done& done) {
                 checks.SetCheckBaseline(request.actor(), request.arguments[0], done);
               });
}

void AddSettingsRoutes(Routes& routes, SettingsService& settings, AuditLog& audit) {
  routes
      .ReadInBackground(
          "/api/v1/audit", Permission::kAudit,
          [&audit](const Request& request) {
            const auto before = QueryNumber(request, "before", 0, std::int64_t{1} << 53);
            const auto limit = static_cast<int>(QueryNumber(request, "limit", 100, kMaxListed));
            const bool views = QueryNumber(request, "views", 1, 1) == 1;
            return JsonResponse({{"entries", audit.Audit({before, limit, "", views})}});
          })
      .Discloses("view.log");
  routes
      .ReadInBackground("/api/v1/audit.jsonl", Permission::kAudit,
                        [&audit](const Request&) {
                          return Download("application/x-ndjson", audit.ExportAudit(),
                                          "plumb_log.jsonl");
                        })
      .Discloses("", "download.log");
  routes.Read("/api/v1/settings", Permission::kView, [&settings](const Request&) {
    return JsonResponse(SettingsAs<Json>(settings.GetSettings()));
  });
  routes.Write("PUT", "/api/v1/settings", Permission::kSettings, BodyKind::kJson,
               [&settings](const Request& request, const Done& done) {
                 settings.ChangeSettings(request.actor(), ParseSettingsChange(request.body), done);
               });
}

void AddUpdateRoutes(Routes& routes, UpdateService& updates) {
  routes.Read("/api/v1/update", Permission::kView, [&updates](const Request&) {
    Json answer = updates.GetUpdate();
    answer["stick"] = updates.StickBundles();
    return JsonResponse(answer);
  });
  routes.Write("POST", "/api/v1/update", Permission::kUpdate, BodyKind::kJson,
               [&updates](const Request& request, const Done& done) {
                 Fields fields(request.body);
                 const std::string bundle = fields.Text("bundle", 1, 64);
                 const bool from_stick = fields.Has("from_stick") && fields.Flag("from_stick");
                 fields.Finish();
                 if (!IsName(bundle)) throw DataError("bundle must be one of the names listed");
                 if (from_stick) return updates.InstallFromStick(request.actor(), bundle, done);
                 updates.InstallUpdate(request.actor(), bundle, done);
               });
  routes.Write("POST", "/api/v1/update/bundles/{name}", Permission::kUpdate, BodyKind::kFile,
               [&updates](const Request& request, const Done& done) {
                 const std::string& name = request.arguments[0];
                 if (!name.ends_with(".raucb"))
                   throw DataError("a bundle's name must end with .raucb");
                 updates.AddBundle(
                     request.actor(), request.upload->path(), name,
                     [done, kept = request.upload](const Change& change) { done(change); });
               });
  routes.Write("POST", "/api/v1/update/seen", Permission::kUpdate, BodyKind::kNone,
               [&updates](const Request& request, const Done& done) {
                 updates.ForgetRollBack(request.actor(), done);
               });
  routes.Write("DELETE", "/api/v1/update/bundles/{name}", Permission::kUpdate, BodyKind::kNone,
               [&updates](const Request& request, const Done& done) {
                 updates.RemoveBundle(request.actor(), request.arguments[0], done);
               });
}

void AddMaintenanceRoutes(Routes& routes, MaintenanceService& maintenance, AuditLog& audit) {
  routes.ReadInBackground("/api/v1/backup", Permission::kSettings, [&audit](const Request&) {
    return JsonResponse({{"last", LastBackup(audit)}});
  });
  routes.Write("POST", "/api/v1/backup", Permission::kSettings, BodyKind::kNone,
               [&maintenance](const Request& request, const Done& done) {
                 maintenance.MakeBackup(request.actor(), done);
               });
  routes.Add("POST", "/api/v1/diagnostics", Permission::kDiagnostics, BodyKind::kNone,
             [&maintenance](const Request& request, const Respond& respond) {
               maintenance.WriteDiagnostics(request.actor(), [respond](const Change& change) {
                 if (change.result != ChangeResult::kDone) return respond(ChangeResponse(change));
                 Response response =
                     FileResponse(change.file, "application/octet-stream",
                                  "plumb-diagnostics" + change.file.extension().string());
                 std::error_code ignored;
                 fs::remove(change.file, ignored);  // stays readable through the open descriptor
                 respond(std::move(response));
               });
             });
}

}  // namespace

void AddApiRoutes(Routes& routes, const Services& services) {
  AddApplianceRoutes(routes, services.appliance);
  AddPatientRoutes(routes, services.patients, services.references, services.scans);
  AddTemplateRoutes(routes, services.settings);
  AddReferenceRoutes(routes, services.references);
  AddScanRoutes(routes, services.scans);
  AddCheckRoutes(routes, services.checks);
  AddSettingsRoutes(routes, services.settings, services.audit);
  AddUpdateRoutes(routes, services.updates);
  AddMaintenanceRoutes(routes, services.maintenance, services.audit);
}

}  // namespace plumb::web
